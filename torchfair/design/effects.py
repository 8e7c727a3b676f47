"""What a design wants done by those who have sockets, processes and disks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .engine.requests import Request
from .engine.saying import Shown


@dataclass(frozen=True)
class Effect:
    """Something to be done."""


@dataclass(frozen=True)
class Tell(Effect):
    """Sends a message.

    Attributes:
        message: An object, or a container.
        window: To whom; None for all.
    """

    message: dict[str, Any] | bytes
    window: int | None = None


@dataclass(frozen=True)
class Draw(Effect):
    """Shows a frame as soon as the last one was acknowledged.

    Attributes:
        frame: The state.
        number: Of the frame.
        window: To whom; None for all.
    """

    frame: Shown
    number: int
    window: int | None = None


@dataclass(frozen=True)
class Ask(Effect):
    """Asks the engine.

    Attributes:
        request: What for.
    """

    request: Request


@dataclass(frozen=True)
class StartEngine(Effect):
    """Starts an engine, after ending the one that there is."""


@dataclass(frozen=True)
class Store(Effect):
    """Writes a file.

    Attributes:
        path: Where, as :class:`torchfair.design.folder.Folder` has allowed it.
        content: Makes its bytes.
        overwrite: Whether it may replace one.
        window: Who is told of it; None for nobody.
        id: Of the command.
    """

    path: str
    content: Callable[[], bytes]
    overwrite: bool
    window: int | None = None
    id: int | None = None


@dataclass(frozen=True)
class Deliver(Effect):
    """Sends a file to be downloaded.

    Attributes:
        name: Of the file.
        content: Makes its bytes.
        window: To whom.
        id: Of the command.
    """

    name: str
    content: Callable[[], bytes]
    window: int
    id: int | None = None


@dataclass(frozen=True)
class Autosave(Effect):
    """Keeps the design safe, now or a little later.

    Attributes:
        content: Makes the bytes of a session file; None to remove what was kept.
    """

    content: Callable[[], bytes] | None


@dataclass(frozen=True)
class Wake(Effect):
    """Calls :meth:`torchfair.design.session.DesignSession.awoken` later.

    Attributes:
        seconds: How much later.
        why: Comes back.
    """

    seconds: float
    why: str
