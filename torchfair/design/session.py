"""A design as a state machine: commands and events in, effects out; no sockets, no threads, no clock of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .commands import Command, CommandRefused
from .containers import JUMP
from .core import Core
from .document import Document
from .edits import EDITS
from .effects import Draw, Effect, StartEngine, Tell, Wake
from .engine import requests as r
from .engine import saying as say
from .events import heard
from .folder import Folder
from .history import History
from .inquiries import INQUIRIES
from .limits import MOST_UPLOAD
from .states import ALLOWED, DesignState
from .telling import error_message, handles_message

_PATIENCE = 2.0  # seconds after which a drag is let go whose window has gone
_FIRST = ("settings", "topology")
_HANDLERS = {**EDITS, **INQUIRIES}


class DesignSession:
    """One design, for any number of windows.

    Every method returns what has to be done about it, in order.

    Args:
        folder: Where files are.
        clock: Seconds.
        upload_bytes: Largest upload.

    Example::

        session = DesignSession(Folder("."), time.monotonic)
        effects = session.begin(Open(0, "example:roof"))
        effects += session.window_opened(1)
    """

    def __init__(self, folder: Folder, clock: Callable[[], float], upload_bytes: int = MOST_UPLOAD) -> None:
        self._core = Core(folder, clock, upload_bytes)

    @property
    def state(self) -> DesignState:
        """What it is doing."""
        return self._core.state

    @property
    def history(self) -> History[Document]:
        """All that was made."""
        return self._core.history

    @property
    def document(self) -> Document | None:
        """What is on the screen: the last settled shape, with what a drag has changed."""
        return self._core.document

    @property
    def title(self) -> str:
        """Of the mesh on the screen; empty before there is one."""
        return "" if self.document is None else self.document.title

    def begin(self, opening: r.Open | None = None) -> list[Effect]:
        """The engine is started, and a first mesh opened."""
        return [StartEngine(), *([] if opening is None else self._core.open(opening, None, None))]

    # ---- windows ---------------------------------------------------------------------------------------

    def window_opened(self, window: int) -> list[Effect]:
        """A window that says hello is told everything."""
        core = self._core
        core.windows[window] = ()
        told: list[Effect] = [Tell(core.state_message(), window)]
        told += [Tell(core.kept[name], window) for name in _FIRST if name in core.kept]
        if core.frame is not None:
            told.append(Draw(replace(core.frame, flags=core.frame.flags | JUMP), core.frames, window))
        if self.document is not None:
            told.append(Tell(handles_message(self.document), window))
        told += [Tell(kept, window) for name, kept in core.kept.items() if name not in _FIRST]
        if core.question is not None:
            told.append(Tell(core.question, window))
        return [*told, *core.tell_state(all_but=window)]

    def window_closed(self, window: int) -> list[Effect]:
        """A drag of a window that has gone is let go a little later."""
        core = self._core
        core.windows.pop(window, None)
        effects: list[Effect] = [core.watch(), *core.tell_state()]
        if core.drag is not None and core.drag.window == window:
            effects.append(Wake(_PATIENCE, f"drag {core.drag.serial}"))
        return effects

    def awoken(self, why: str) -> list[Effect]:
        """What was asked for by :class:`~torchfair.design.effects.Wake`."""
        core, drag = self._core, self._core.drag
        if drag is None or why != f"drag {drag.serial}" or drag.window in core.windows:
            return []
        return core.let_go()

    def command(self, window: int, command: Command) -> list[Effect]:
        """Does a command, or says why not; then nothing has changed."""
        core, kind = self._core, command.type
        try:
            if kind not in ALLOWED:
                raise CommandRefused(f"{kind} is no command to a design")
            if core.state not in ALLOWED[kind]:
                raise CommandRefused(f"{kind} is not possible now: {core.doing}")
            return _HANDLERS[kind](core, window, command)
        except CommandRefused as refused:
            return [Tell(error_message(str(refused), kind, command.id), window)]

    # ---- the engine ------------------------------------------------------------------------------------

    def engine_said(self, event: say.Event) -> list[Effect]:
        """What follows from what the engine says."""
        return heard(self._core, event)

    def engine_lost(self) -> list[Effect]:
        """The engine has ended by itself: another one is started."""
        pending = self._core.pending
        during = f" ({pending.busy})" if pending is not None and pending.busy else ""
        return self._core.restart(f"the engine has ended{during}; the last settled shape comes back")
