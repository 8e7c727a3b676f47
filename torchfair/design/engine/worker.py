"""What the engine does with requests, one after the other."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from torch import Tensor

from ...errors import TorchfairError
from ...shapes import EXAMPLES, SURFACES
from ..containers import AT_REST, DRAGGING, JUMP
from ..document import Document
from . import requests as r
from . import saying as say
from .follower import Follower
from .inbox import Inbox, Pipe
from .measures import edge_bytes, live_numbers, view
from .opening import opened
from .pictured import topology_message
from .remaking import remade
from .sliders import settings_message
from .writing import file_bytes, strips_message

_BETWEEN_NUMBERS = 0.2  # seconds
_BETWEEN_FRAMES = 1.0 / 40.0
_PAUSE = 0.15  # seconds without a move of the mouse, after which a large mesh takes a step
_FAULTS = (TorchfairError, OSError, RuntimeError, ValueError, IndexError, MemoryError)


class Worker:
    """Computes.

    Args:
        pipe: Where requests come from.
        say: Sends what it has to say.
        clock: Seconds.
    """

    def __init__(
        self, pipe: Pipe, say: Callable[[say.Event], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._say, self._clock = say, clock
        self._inbox = Inbox(pipe, self._watching)
        self._follower: Follower | None = None
        self._views: tuple[str, ...] = ()
        self._worst, self._shown_number = 8, -1
        self._told_settings: dict[str, Any] = {}
        self._measured = self._framed = -1e9

    def run(self) -> None:
        """Until the other end of the pipe is gone. Nothing is computed while nothing has to be done."""
        self._say(say.Started(0, (*EXAMPLES, *SURFACES)))
        while True:
            self.do(self.next())

    def waits(self) -> bool:
        """Whether there is something to do."""
        return self._inbox.has_more()

    def next(self) -> r.Request:
        """The next thing to do, waited for without end."""
        return self._inbox.next()

    def do(self, request: r.Request) -> None:
        """One request; what goes wrong is said."""
        try:
            self._do(request)
        except _FAULTS as error:
            self._say(say.Failed(request.serial, _sentence(error)))

    def _do(self, request: r.Request) -> None:
        if isinstance(request, r.Take):
            self._take(request)
        elif isinstance(request, r.Drag):
            self._drag(request)
        elif isinstance(request, r.Release):
            self._settle(request.serial, whole=False)
        elif isinstance(request, r.Open):
            self._say(opened(request))
        elif isinstance(request, r.Remake):
            document, notes = remade(request.document, request.how, request.options)
            self._say(say.Made(request.serial, (document,), notes=tuple(notes)))
        elif isinstance(request, r.Write):
            self._say(say.Answered(request.serial, file_bytes(request.document, request.format)))
        elif isinstance(request, r.Unroll):
            self._say(say.Answered(request.serial, strips_message(request.document)))

    # ---- the mesh on the screen ------------------------------------------------------------------------

    def _take(self, request: r.Take) -> None:
        self._follower = self._followed(request.document, request.serial)
        self._tell_of_mesh(request.serial)
        self._show(request.serial, JUMP if request.then else JUMP | AT_REST)
        if request.then:
            self._settle(request.serial, whole=request.then == "solve")
        else:
            self._measure(request.serial, rest=True)
            self._done(request.serial, stopped=False)

    def _followed(self, document: Document, serial: int) -> Follower:
        if self._follower is None:
            return Follower(document, serial)
        return self._follower.taking(document, serial)

    def _drag(self, request: r.Drag) -> None:
        """Steps until something else waits, or the mesh has caught up with its handles."""
        follower, drag = self._following(), request
        follower.drag(drag.places, drag.weights)
        while True:
            newer = self._inbox.next_drag(drag.serial)
            if newer is not None:
                drag = newer
                follower.drag(drag.places, drag.weights)
            elif self._inbox.has_more():
                return
            if self._inbox.paused:
                self._inbox.wait()
                continue
            coarse = follower.coarse()
            if coarse is not None:
                self._show_vertices(coarse, drag.serial, DRAGGING, drag.count)
                if self._inbox.comes_within(_PAUSE):
                    continue
            stepped = follower.step()
            if stepped.moved or coarse is not None:
                self._show(drag.serial, DRAGGING, drag.count)
            self._measure(drag.serial, now=not stepped.goes_on)
            if not stepped.goes_on and not self._inbox.has_more():
                return

    def _settle(self, serial: int, *, whole: bool) -> None:
        follower = self._following()

        def watch(vertices: Tensor) -> None:
            if self._clock() - self._framed >= _BETWEEN_FRAMES:
                self._show_vertices(vertices, serial, 0, 0)
                if self._clock() - self._measured >= _BETWEEN_NUMBERS:
                    self._measure_vertices(vertices, serial)

        def stop() -> bool:
            return self._inbox.is_stopped(serial)

        stopped = follower.settle(whole=whole, stop=stop, watch=watch)
        while (newer := self._inbox.next_drag(serial)) is not None:  # weights that were turned meanwhile
            follower.drag(newer.places, newer.weights)
            stopped = follower.settle(whole=whole, stop=stop, watch=watch)
        goes_on = stopped and self._inbox.has_more()
        self._show(serial, 0 if goes_on else AT_REST)
        if not goes_on:
            self._measure(serial, rest=True)
        self._done(serial, stopped=stopped)

    def _following(self) -> Follower:
        if self._follower is None:
            raise TorchfairError("nothing is open")
        return self._follower

    # ---- saying ----------------------------------------------------------------------------------------

    def _tell_of_mesh(self, serial: int) -> None:
        follower = self._following()
        if follower.number != self._shown_number:
            message = topology_message(follower.document, follower.topology, follower.number)
            self._say(say.Said(serial, "topology", message))
            self._shown_number = follower.number
        self._tell_settings(serial)

    def _tell_settings(self, serial: int) -> None:
        message = settings_message(self._following().document)
        if message != self._told_settings:
            self._told_settings = message
            self._say(say.Said(serial, "settings", message))

    def _show(self, serial: int, flags: int, count: int = 0) -> None:
        self._show_vertices(self._following().vertices, serial, flags, count)

    def _show_vertices(self, vertices: Tensor, serial: int, flags: int, count: int) -> None:
        follower = self._following()
        edges, scale = edge_bytes(vertices, follower.topology)
        origin, places = follower.document.origin, vertices.numpy().copy()
        self._framed = self._clock()
        self._say(say.Shown(serial, follower.number, places, origin, edges, scale, flags, count))

    def _measure(self, serial: int, *, rest: bool = False, now: bool = False) -> None:
        if rest or now or self._clock() - self._measured >= _BETWEEN_NUMBERS:
            self._measure_vertices(self._following().vertices, serial, rest=rest)

    def _measure_vertices(self, vertices: Tensor, serial: int, *, rest: bool = False) -> None:
        follower = self._following()
        topology, document = follower.topology, follower.document
        numbers = live_numbers(vertices, topology, document.handles, self._worst)
        numbers |= {"deviation": None, "deviation_back": None, "promises": None, "status": follower.status}
        if rest:
            numbers["deviation"] = float(follower.deviation.there(vertices).max())
            numbers["deviation_back"] = follower.deviation.back(vertices, topology)
            numbers["promises"] = follower.promises()
        self._measured = self._clock()
        self._say(say.Said(serial, "numbers", {"type": "numbers", "rest": rest, **numbers}))
        if rest:
            self._say_views(serial)

    def _say_views(self, serial: int) -> None:
        follower = self._following()
        for name in self._views:
            message = view(name, follower.number, follower.vertices, follower.topology, follower.deviation)
            self._say(say.Said(serial, f"view:{name}", message))

    def _done(self, serial: int, *, stopped: bool) -> None:
        follower = self._following()
        self._tell_settings(serial)
        self._say(say.Done(serial, follower.places, stopped, follower.notes))

    def _watching(self, request: r.Watch) -> None:
        new = [name for name in request.views if name not in self._views]
        changed = bool(new) or request.worst != self._worst
        self._views, self._worst = request.views, request.worst
        if changed and self._follower is not None and self._follower.is_at_rest:
            self._measure(request.serial, rest=True)


def _sentence(error: Exception) -> str:
    """What went wrong, on one line."""
    if isinstance(error, MemoryError):
        return "there is not enough memory for that"
    words = " ".join(str(error).split())
    return words if isinstance(error, TorchfairError | OSError) else f"{type(error).__name__}: {words[:400]}"


def main(pipe: Any) -> None:
    """The engine, until its pipe is closed.

    Args:
        pipe: An end of :func:`multiprocessing.Pipe`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which ends the engine
    with suppress(ImportError):
        import rslab  # noqa: F401  (its allocator takes the thread that imports it for the main one)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        Worker(pipe, pipe.send).run()
