"""The engine as a child process: started, asked, ended, and missed when it is gone."""

from __future__ import annotations

import multiprocessing
import queue
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from .requests import Request
from .saying import Event


class EngineProcess:
    """One child process; a new one is made where this one is gone.

    Args:
        said: Called from a thread with every event.
        lost: Called from a thread, once, when the process has ended by itself.
    """

    def __init__(self, said: Callable[[Event], None], lost: Callable[[], None]) -> None:
        context = multiprocessing.get_context("spawn")
        own, others = context.Pipe()
        self._said, self._lost, self._ended = said, lost, False
        self._pipe: Connection[Any, Any] = own
        self._process = context.Process(target=_begin, args=(others,), daemon=True, name="torchfair-engine")
        self._process.start()
        others.close()
        self._requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        for task in (self._read, self._write):
            threading.Thread(target=task, daemon=True, name=f"torchfair-engine{task.__name__}").start()

    @property
    def pid(self) -> int | None:
        """Number of the process."""
        return self._process.pid

    def ask(self, request: Request) -> None:
        """Puts a request in line; returns at once."""
        self._requests.put(request)

    def end(self) -> None:
        """Kills the process; nothing is said any more."""
        self._ended = True
        self._requests.put(None)
        self._process.kill()
        self._process.join(5.0)

    def _write(self) -> None:
        while (request := self._requests.get()) is not None:
            try:
                self._pipe.send(request)
            except (OSError, ValueError):  # the reader sees the end, too
                return

    def _read(self) -> None:
        try:
            while True:
                event = self._pipe.recv()
                if not self._ended:
                    self._said(event)
        except (EOFError, OSError):
            pass
        self._process.join(5.0)
        self._requests.put(None)
        if not self._ended:
            self._ended = True
            self._lost()


def _begin(pipe: Any) -> None:
    """What the child runs; imported there, so that nothing of the server is."""
    from .worker import main

    main(pipe)
