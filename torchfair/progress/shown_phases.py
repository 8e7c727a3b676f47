"""What a command is at, while it takes long."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from .long_phases import PATIENCE, LongPhases
from .phases import listening
from .time_left import duration

_REFRESH = 0.5  # seconds
_ERASE = "\r\x1b[K"


@contextmanager
def shown_phases(*, patience: float = PATIENCE, stream: TextIO | None = None) -> Iterator[None]:
    """Shows on a terminal at which :func:`~torchfair.progress.phase` the work within is, once that takes long.

    Words and the time so far are redrawn in place and gone at the end, however that comes about. Nothing is written
    where the stream, by default stderr, is no terminal. A :class:`~torchfair.progress.ProgressDisplay` within shows its
    phases itself.

    Example::

        with shown_phases(), phase("judging stars"):
            classify_stars(vertices, topology)

    Args:
        patience: Seconds before a phase is shown.
        stream: Where to.
    """
    shown = stream or sys.stderr
    if shown is None or not shown.isatty():
        yield
        return
    drawn = False

    def write(text: str) -> None:
        nonlocal drawn
        with suppress(OSError, ValueError):  # the terminal is closed: nobody looks
            shown.write(text)
            shown.flush()
        drawn = text != _ERASE

    def begin(words: str) -> None:
        phases(words)
        if drawn:
            write(_ERASE)

    phases = LongPhases(
        lambda words, seconds: write(f"{_ERASE}{words}  {duration(seconds)}"), patience=patience, refresh=_REFRESH
    )
    try:
        with listening(begin):
            yield
    finally:
        begin("")
