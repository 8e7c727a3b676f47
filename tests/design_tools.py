"""A design without sockets, threads or processes: commands in, messages out, computed in between."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np

from torchfair.design.commands import Command, checked_command
from torchfair.design.containers import unpack
from torchfair.design.document import Document, Faces
from torchfair.design.effects import Ask, Autosave, Deliver, Draw, Effect, StartEngine, Store, Tell, Wake
from torchfair.design.engine.requests import Open, Request
from torchfair.design.engine.saying import Event, Failed, Shown
from torchfair.design.engine.worker import Worker
from torchfair.design.folder import Folder
from torchfair.design.session import DesignSession


class Queue:
    """An end of a pipe whose other end is a list."""

    def __init__(self) -> None:
        self.waiting: deque[Request] = deque()

    def poll(self, timeout: float | None = 0.0) -> bool:
        return bool(self.waiting)

    def recv(self) -> Request:
        if not self.waiting:
            raise EOFError
        return self.waiting.popleft()


class Bench:
    """A session and a worker on one thread.

    Attributes:
        session: The design.
        told: Messages to windows since :meth:`clear`, containers unpacked as ``(message, arrays)``.
        frames: States that were drawn.
        stored: Effects that write files.
        events: All that the engine has said.
        starts: How often the engine was started.
    """

    def __init__(self, folder: Path, opening: Open | None = None) -> None:
        self.time = 0.0
        self.session = DesignSession(Folder(folder), lambda: self.time)
        self.pipe = Queue()
        self.told: list[Any] = []
        self.frames: list[Shown] = []
        self.stored: list[Store | Deliver | Autosave | Wake] = []
        self.events: list[Event] = []
        self.starts = 0
        self.worker = self._worker()
        self.session.window_opened(1)
        self.carry_out(self.session.begin(opening))
        self.run()

    def _worker(self) -> Worker:
        return Worker(self.pipe, self._said, lambda: self.time)

    def _said(self, event: Event) -> None:
        self.time += 0.01
        self.events.append(event)
        self.carry_out(self.session.engine_said(event))

    def carry_out(self, effects: Sequence[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Tell):
                message = effect.message
                self.told.append(unpack(message) if isinstance(message, bytes) else message)
            elif isinstance(effect, Draw):
                self.frames.append(effect.frame)
            elif isinstance(effect, Ask):
                self.pipe.waiting.append(effect.request)
            elif isinstance(effect, StartEngine):
                self.starts += 1
            else:
                assert isinstance(effect, Store | Deliver | Autosave | Wake)
                self.stored.append(effect)

    def run(self) -> None:
        """Until the engine has nothing to do."""
        while self.worker.waits():
            self.worker.do(self.worker.next())

    def say(self, window: int = 1, **fields: Any) -> list[Any]:
        """A command, everything that follows from it, and what was told meanwhile."""
        before = len(self.told)
        value = dict(fields)
        command = Command("upload", value) if fields["type"] == "upload" else checked_command(value)
        self.carry_out(self.session.command(window, command))
        self.run()
        return self.told[before:]

    def messages(self, kind: str) -> list[Any]:
        """Messages of a type, arrays beside those that have some."""
        found = [(m if isinstance(m, dict) else m[0], m) for m in self.told]
        return [whole for head, whole in found if head["type"] == kind]

    @property
    def errors(self) -> list[str]:
        return [message["sentence"] for message in self.messages("error")]

    @property
    def vertices(self) -> Any:
        return self.session.history.now.vertices


class ThreadEngine:
    """The engine in a thread: as the child process, but quickly there."""

    pid = None

    def __init__(self, said: Callable[[Event], None], lost: Callable[[], None]) -> None:
        self._own, self._others = Pipe()
        worker = Worker(self._others, said)
        self._thread = threading.Thread(target=self._run, args=(worker,), daemon=True)
        self._thread.start()

    def _run(self, worker: Worker) -> None:
        try:
            worker.run()
        except (EOFError, OSError):
            self._others.close()

    def ask(self, request: Request) -> None:
        self._own.send(request)

    def end(self) -> None:
        self._own.close()
        self._thread.join(20.0)


def triangle_document(title: str = "two") -> Document:
    """Two triangles with an edge between them."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 1, 0]])
    faces = Faces(np.array([0, 1, 2, 0, 2, 3]), np.array([0, 3, 6]))
    return Document(title, "fair", faces, vertices, vertices, history=({"do": "open", "source": title},))


def failures(bench: Bench) -> list[str]:
    """What the engine could not do."""
    return [event.sentence for event in bench.events if isinstance(event, Failed)]
