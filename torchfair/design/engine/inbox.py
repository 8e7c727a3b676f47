"""What waits to be done: of moves the newest wins, and what stops or pauses is seen at once."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

from .requests import Drag, Pause, Request, Stop, Watch


class Pipe(Protocol):
    """An end of a pipe, as :func:`multiprocessing.Pipe` gives it."""

    def poll(self, timeout: float | None = 0.0) -> bool:
        """Whether something has come."""

    def recv(self) -> Request:
        """What has come; EOFError once the other end is gone."""


class Inbox:
    """Requests in order.

    Args:
        pipe: Where they come from.
        watch: Called at once with what is to be measured.

    Attributes:
        paused: Whether steps have to wait.
    """

    def __init__(self, pipe: Pipe, watch: Callable[[Watch], None]) -> None:
        self._pipe, self._watch = pipe, watch
        self._waiting: deque[Request] = deque()
        self._stopped = 0
        self.paused = False

    def drain(self) -> None:
        """Takes in everything that has come."""
        while self._pipe.poll(0.0):
            self._take(self._pipe.recv())

    def next(self) -> Request:
        """The next thing to do, waited for without end."""
        self.drain()
        while not self._waiting:
            self._take(self._pipe.recv())
        return self._waiting.popleft()

    def next_drag(self, serial: int) -> Drag | None:
        """The newest move of a drag, if that is what comes next."""
        self.drain()
        first = self._waiting[0] if self._waiting else None
        if not isinstance(first, Drag) or first.serial != serial:
            return None
        self._waiting.popleft()
        return first

    def comes_within(self, seconds: float) -> bool:
        """Whether something waits, or comes soon."""
        if not self.has_more() and self._pipe.poll(seconds):
            self.drain()
        return bool(self._waiting)

    def wait(self) -> None:
        """Until something comes."""
        self._take(self._pipe.recv())

    def has_more(self) -> bool:
        """Whether anything waits to be done."""
        self.drain()
        return bool(self._waiting)

    def is_stopped(self, serial: int) -> bool:
        """Whether the request of that serial is to end: it was stopped, or something else waits."""
        self.drain()
        while self.paused and not self._waiting and self._stopped < serial:
            self.wait()
        return self._stopped >= serial or bool(self._waiting)

    def _take(self, request: Request) -> None:
        if isinstance(request, Stop):
            self._stopped = max(self._stopped, request.serial)
        elif isinstance(request, Pause):
            self.paused = request.on
        elif isinstance(request, Watch):
            self._watch(request)
        elif isinstance(request, Drag) and self._waiting and isinstance(self._waiting[-1], Drag):
            last = self._waiting.pop()
            assert isinstance(last, Drag)
            self._waiting.append(last.followed_by(request) if last.serial == request.serial else request)
        else:
            self._waiting.append(request)
