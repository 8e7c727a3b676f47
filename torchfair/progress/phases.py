"""Phases of long work in which nothing iterates: who shows progress is told which one has begun."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Listener = Callable[[str], object]


class _Here(threading.local):
    """Of this thread: listeners, and phases that have begun; the innermost last."""

    def __init__(self) -> None:
        self.listeners: list[Listener] = []
        self.phases: list[str] = []


_here = _Here()


@contextmanager
def phase(words: str) -> Iterator[None]:
    """Tells who listens in this thread what is done in its body.

    A phase within another one is told in its place until it ends. Costs nothing that matters where nobody listens.

    Args:
        words: Such as ``"checking the result"``.

    Example:
        >>> from torchfair.progress import listening, phase
        >>> with listening(print), phase("checking the result"):
        ...     pass
        checking the result
        <BLANKLINE>
    """
    _here.phases.append(words)
    try:
        _tell(words)
        yield
    finally:
        _here.phases.pop()
        _tell(_here.phases[-1] if _here.phases else "")


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Calls ``listener`` with the words of every phase that begins in this thread, and with "" where none is left.

    Of several the innermost listens; for the others no phase goes on until it is gone.
    """
    if _here.phases:
        _tell("")
    _here.listeners.append(listener)
    try:
        yield
    finally:
        _here.listeners.pop()
        if _here.phases:
            _tell(_here.phases[-1])


def _tell(words: str) -> None:
    if _here.listeners:
        _here.listeners[-1](words)
