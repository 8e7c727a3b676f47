"""What the engine says of what it was asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..containers import Array
from ..document import Document, Floats


@dataclass(frozen=True)
class Event:
    """Something that the engine says.

    Attributes:
        serial: Of the request that it belongs to.
    """

    serial: int


@dataclass(frozen=True)
class Started(Event):
    """The engine is there.

    Attributes:
        examples: Names of meshes that need no file.
    """

    examples: tuple[str, ...] = ()


@dataclass(frozen=True)
class Shown(Event):
    """A state to be drawn.

    Attributes:
        topology: Number of the topology that it belongs to.
        vertices: (V, 3).
        origin: (3,) that positions of frames are relative to.
        edges: (E,) uint8, in parts of ``scale``.
        scale: What 255 stands for.
        flags: See :func:`torchfair.design.containers.frame`.
        count: Of the newest move that it answers.
    """

    topology: int
    vertices: Floats
    origin: Floats
    edges: Array
    scale: float
    flags: int
    count: int = 0


@dataclass(frozen=True)
class Said(Event):
    """A message for all windows, and for those that come later.

    Attributes:
        keep: Under which name it is kept, until the next one of that name.
        message: An object, or a container.
    """

    keep: str
    message: dict[str, Any] | bytes


@dataclass(frozen=True)
class Done(Event):
    """The end of :class:`Take` and :class:`Release`.

    Attributes:
        vertices: (V, 3) where the mesh is now.
        stopped: Whether it was stopped.
        notes: What is to be known, in sentences.
    """

    vertices: Floats
    stopped: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Made(Event):
    """A mesh that was read or made.

    Attributes:
        documents: Its history, which is one document for a mesh.
        now: Which of them it is.
        notes: What was done, in sentences.
        camera: That of a session file.
        is_session: Whether it is one.
    """

    documents: tuple[Document, ...]
    now: int = 0
    notes: tuple[str, ...] = ()
    camera: Mapping[str, Any] | None = None
    is_session: bool = False


@dataclass(frozen=True)
class Asked(Event):
    """A question, before anything is done.

    Attributes:
        sentence: What is the matter.
        choices: Value and words of every answer.
    """

    sentence: str
    choices: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Answered(Event):
    """The end of :class:`Write` and :class:`Unroll`.

    Attributes:
        data: Bytes of the file, or a container.
    """

    data: bytes


@dataclass(frozen=True)
class Failed(Event):
    """It cannot be done; nothing has changed.

    Attributes:
        sentence: Why.
    """

    sentence: str
