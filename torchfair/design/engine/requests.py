"""What is asked of the engine, and what it says; both go through a pipe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..document import Document, Place


@dataclass(frozen=True)
class Request:
    """Something to do.

    Attributes:
        serial: Comes back in what is said of it.
    """

    serial: int


@dataclass(frozen=True)
class Take(Request):
    """This is the mesh from now on; ends with :class:`Done`.

    Attributes:
        document: The mesh.
        then: What follows: ``""``, ``"settle"`` or ``"solve"``.
    """

    document: Document
    then: str = ""


@dataclass(frozen=True)
class Drag(Request):
    """Handles are here now, and weights are these; of several that wait only the newest counts.

    Attributes:
        places: By vertex.
        weights: By name.
        count: Number of the move, for frames.
    """

    places: Mapping[int, Place] = field(default_factory=dict)
    weights: Mapping[str, float] = field(default_factory=dict)
    count: int = 0

    def followed_by(self, other: Drag) -> Drag:
        """Both at once."""
        return Drag(other.serial, {**self.places, **other.places}, {**self.weights, **other.weights}, other.count)


@dataclass(frozen=True)
class Release(Request):
    """The drag is over; ends with :class:`Done` once the mesh is at rest."""


@dataclass(frozen=True)
class Open(Request):
    """Reads a mesh or a session file; ends with :class:`Made`, :class:`Asked` or :class:`Failed`.

    Attributes:
        name: A path, ``example:NAME``, or the name of what is uploaded.
        data: What is uploaded; None for a file.
        title: What the mesh shall be called.
        repair: How it is read, in the words of the command line: ``repair``, ``weld=0.01``.
        asked: Whether a person has decided how it is read, so that nothing is asked again.
        fresh: Whether a person has decided to open the file itself, not what was kept of its edits.
    """

    name: str
    data: bytes | None = None
    title: str = ""
    repair: tuple[str, ...] = ()
    asked: bool = False
    fresh: bool = False


@dataclass(frozen=True)
class Remake(Request):
    """Another mesh from this one; ends with :class:`Made` or :class:`Failed`.

    Attributes:
        document: The mesh.
        how: ``subdivide``, ``mesh`` or ``label``.
        options: Of the command.
    """

    document: Document
    how: str
    options: Mapping[str, Any]


@dataclass(frozen=True)
class Write(Request):
    """A mesh or its strips in the bytes of a file; ends with :class:`Answered` or :class:`Failed`.

    Attributes:
        document: The mesh.
        format: Such as ``obj``.
    """

    document: Document
    format: str


@dataclass(frozen=True)
class Unroll(Request):
    """Strips along principal edges; ends with :class:`Answered` or :class:`Failed`.

    Attributes:
        document: The mesh.
    """

    document: Document


# ---- to be done at once, whatever is going on ------------------------------------------------------------------------


@dataclass(frozen=True)
class Stop(Request):
    """Ends the request of that serial with the best so far."""


@dataclass(frozen=True)
class Pause(Request):
    """No steps from now on, or steps again.

    Attributes:
        on: Which of both.
    """

    on: bool


@dataclass(frozen=True)
class Watch(Request):
    """What to measure besides.

    Attributes:
        views: Names.
        worst: How many worst edges to list.
    """

    views: tuple[str, ...]
    worst: int
