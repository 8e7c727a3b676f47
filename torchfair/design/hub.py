"""Windows, the design and its engine on one event loop: carries out what the design wants done."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..errors import TorchfairError
from .autosave import Keeper
from .commands import CommandRefused, read_command
from .containers import frame
from .effects import Ask, Autosave, Deliver, Draw, Effect, StartEngine, Store, Tell, Wake
from .engine.requests import Open, Request
from .engine.saying import Event, Shown
from .files import download_message, store, upload_command
from .session import DesignSession
from .telling import error_message
from .windows import FrameGate


class Engine(Protocol):
    """What computes; see :class:`torchfair.design.engine.process.EngineProcess`."""

    @property
    def pid(self) -> int | None:
        """Number of its process."""

    def ask(self, request: Request) -> None:
        """Puts a request in line."""

    def end(self) -> None:
        """Ends it."""


MakeEngine = Callable[[Callable[[Event], None], Callable[[], None]], Engine]
"""Makes an engine from what is called with every event, and what is called when it has ended by itself."""


@dataclass
class Window:
    """One window of the browser.

    Attributes:
        gate: Which frames it gets.
        outgoing: What has to be sent to it, in order.
    """

    gate: FrameGate = field(default_factory=FrameGate)
    outgoing: asyncio.Queue[str | bytes] = field(default_factory=asyncio.Queue)


class Hub:
    """One design in any number of windows.

    All methods are called on one event loop.

    Args:
        session: The design.
        keeper: Of what is not saved.
        make_engine: Starts what computes.

    Attributes:
        session: The design.
        engine: What computes now; None before :meth:`start`.
    """

    def __init__(self, session: DesignSession, keeper: Keeper, make_engine: MakeEngine) -> None:
        self.session, self._keeper, self._make_engine = session, keeper, make_engine
        self.engine: Engine | None = None
        self._windows: dict[int, Window] = {}
        self._opened = self._engines = 0
        self._tasks: set[asyncio.Task[None]] = set()

    def start(self, opening: Open | None) -> None:
        """Starts the engine, and opens the first mesh."""
        self._loop = asyncio.get_running_loop()
        self._do(self.session.begin(opening))

    async def stop(self) -> None:
        """Ends the engine; what was not saved is kept."""
        engine, self.engine = self.engine, None
        if engine is not None:
            await asyncio.to_thread(engine.end)
        await asyncio.to_thread(self._keeper.finish)

    # ---- windows ---------------------------------------------------------------------------------------

    @property
    def num_windows(self) -> int:
        """How many there are."""
        return len(self._windows)

    def enter(self, welcome: Mapping[str, Any]) -> tuple[int, Window]:
        """Another window, with its number; it is told everything."""
        self._opened += 1
        window = self._windows[self._opened] = Window()
        self._put(self._opened, json.dumps(welcome))
        self._do(self.session.window_opened(self._opened))
        return self._opened, window

    def leave(self, number: int) -> None:
        """A window that has gone."""
        del self._windows[number]
        self._do(self.session.window_closed(number))

    def hear(self, number: int, message: str | bytes) -> None:
        """What a window says."""
        try:
            command = read_command(message) if isinstance(message, str) else upload_command(message)
        except CommandRefused as refused:
            self._put(number, json.dumps(error_message(str(refused), refused.command, refused.id)))
            return
        if command.type != "ack":
            self._do(self.session.command(number, command))
            return
        following = self._windows[number].gate.acknowledged(command["frame"])
        if following is not None:
            self._put(number, following)

    def _put(self, number: int, message: str | bytes) -> None:
        if number in self._windows:
            self._windows[number].outgoing.put_nowait(message)

    def _of(self, number: int | None) -> list[int]:
        return list(self._windows) if number is None else [number]

    # ---- effects ---------------------------------------------------------------------------------------

    def _do(self, effects: Sequence[Effect]) -> None:
        for effect in effects:
            self._WAYS[type(effect)](self, effect)

    def _tell(self, effect: Tell) -> None:
        message = effect.message if isinstance(effect.message, bytes) else json.dumps(effect.message)
        for number in self._of(effect.window):
            self._put(number, message)

    def _draw(self, effect: Draw) -> None:
        data = frame_bytes(effect.frame, effect.number)
        for number in self._of(effect.window):
            now = self._windows[number].gate.offer(effect.number, data) if number in self._windows else None
            if now is not None:
                self._put(number, now)

    def _ask(self, effect: Ask) -> None:
        if self.engine is not None:
            self.engine.ask(effect.request)

    def _wake(self, effect: Wake) -> None:
        self._loop.call_later(effect.seconds, lambda: self._do(self.session.awoken(effect.why)))

    def _autosave(self, effect: Autosave) -> None:
        self._keeper.keep(self.session.title, effect.content)

    def _later(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _file(self, effect: Store | Deliver) -> None:
        self._later(self._make_file(effect))

    async def _make_file(self, effect: Store | Deliver) -> None:
        """Makes a file, and writes it or sends it."""
        done = None if effect.id is None else json.dumps({"type": "done", "id": effect.id})
        try:
            if isinstance(effect, Deliver):
                answer: str | bytes = await asyncio.to_thread(download_message, effect)
            else:
                answer = json.dumps(await asyncio.to_thread(store, effect))
        except (TorchfairError, OSError, ValueError) as error:
            answer, done = json.dumps(error_message(str(error), "save", effect.id)), None
        if effect.window is not None:
            self._put(effect.window, answer)
            if done is not None:
                self._put(effect.window, done)

    def _start_engine(self, effect: StartEngine) -> None:
        """Another engine; whatever the last one still says is not heard."""
        if self.engine is not None:
            self.engine.end()
        number = self._engines = self._engines + 1

        def now(then: Callable[[], Sequence[Effect]]) -> None:
            if number == self._engines and self.engine is not None:
                self._do(then())

        def said(event: Event) -> None:
            self._loop.call_soon_threadsafe(now, lambda: self.session.engine_said(event))

        def lost() -> None:
            self._loop.call_soon_threadsafe(now, self.session.engine_lost)

        self.engine = self._make_engine(said, lost)

    _WAYS: Mapping[type, Callable[[Any, Any], None]] = {
        Tell: _tell,
        Draw: _draw,
        Ask: _ask,
        StartEngine: _start_engine,
        Store: _file,
        Deliver: _file,
        Autosave: _autosave,
        Wake: _wake,
    }


def frame_bytes(shown: Shown, number: int) -> bytes:
    """A state as a frame."""
    return frame(
        shown.vertices - shown.origin, shown.edges, shown.scale, number=number, topology=shown.topology,
        flags=shown.flags, count=shown.count,
    )  # fmt: skip
