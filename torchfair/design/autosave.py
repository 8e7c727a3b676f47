"""What was not saved is kept beside the mesh, a little after every edit."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from .._atomic import atomic_write_bytes
from ..errors import MeshFileError
from .session_file import KEPT

_PAUSE = 3.0  # seconds between two of them


def autosave_path(folder: Path, title: str) -> Path:
    """Where the design of that title is kept: a hidden session file."""
    plain = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in title)[:80]
    return folder / f".{plain or 'design'}{KEPT}"


class Keeper:
    """Writes the newest state in a thread of its own, at most every few seconds; the last one in any case.

    Args:
        folder: Where.
        pause: Seconds between two of them.
    """

    def __init__(self, folder: Path, pause: float = _PAUSE) -> None:
        self._folder, self._pause = folder, pause
        self._lock, self._writing = threading.Lock(), threading.Lock()
        self._next: tuple[Path, Callable[[], bytes]] | None = None
        self._timer: threading.Timer | None = None

    def keep(self, title: str, content: Callable[[], bytes] | None) -> None:
        """Keeps a state soon; None to remove what was kept, since all is saved."""
        path = autosave_path(self._folder, title)
        if content is None:
            with self._lock:
                self._next = None
            with self._writing, suppress(OSError):
                path.unlink()
            return
        with self._lock:
            self._next = path, content
            if self._timer is None:
                self._timer = threading.Timer(self._pause, self._write)
                self._timer.daemon = True
                self._timer.start()

    def finish(self) -> None:
        """Writes what waits."""
        with self._lock:
            timer = self._timer
        if timer is not None:
            timer.cancel()
            self._write()

    def _write(self) -> None:
        with self._lock:
            found, self._next, self._timer = self._next, None, None
        if found is None:
            return
        path, content = found
        with self._writing, suppress(MeshFileError):  # a folder that cannot be written to is no reason to stop
            atomic_write_bytes(path, content(), overwrite=True)
