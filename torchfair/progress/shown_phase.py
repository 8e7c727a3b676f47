"""What a command is at, while it takes long."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from .time_left import duration

_PATIENCE = 2.0  # seconds
_REFRESH = 0.5
_ERASE = "\r\x1b[K"


@contextmanager
def phase_progress(words: str, *, patience: float = _PATIENCE, stream: TextIO | None = None) -> Iterator[None]:
    """Shows ``words`` and the time so far on a terminal while the work within goes on, once it takes long.

    The line is redrawn in place and gone at the end, however that comes about. Nothing is written where the stream, by
    default stderr, is no terminal.

    Example::

        with phase_progress("judging stars"):
            classify_stars(vertices, topology)

    Args:
        words: What is done.
        patience: Seconds before anything is shown.
        stream: Where to.
    """
    shown = stream or sys.stderr
    if not shown.isatty():
        yield
        return
    ended, start = threading.Event(), time.monotonic()

    def show() -> None:
        drawn = False
        pause = patience
        with suppress(OSError, ValueError):  # the terminal is closed: nobody looks
            while not ended.wait(pause):
                shown.write(f"{_ERASE}{words}  {duration(time.monotonic() - start)}")
                shown.flush()
                drawn, pause = True, _REFRESH
            if drawn:
                shown.write(_ERASE)
                shown.flush()

    thread = threading.Thread(target=show, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
