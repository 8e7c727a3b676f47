"""Ctrl-C that loses nothing: it waits until the work at hand is done, and acts at once where it may."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TypeVar

_T = TypeVar("_T")
_here = threading.local()  # the interrupts that wait in this thread


class Interrupts:
    """What has become of Ctrl-C while :func:`deferred_interrupts` is in force.

    Attributes:
        pending: Whether one is waiting.
    """

    def __init__(self) -> None:
        self.pending = False

    def check(self) -> None:
        """Raises KeyboardInterrupt if one is waiting, which it then no longer is."""
        if self.pending:
            self.pending = False
            raise KeyboardInterrupt

    def interruptible(self, work: Callable[..., _T], *arguments: object) -> _T:
        """The value of ``work(*arguments)``, in which Ctrl-C acts as it did before; one that waits acts before it."""
        self.check()
        try:
            _here.interrupts = None  # jobs within the work are jobs of their own
            self._leave()
            return work(*arguments)
        finally:
            self._hold()
            _here.interrupts = self

    def insist(self, work: Callable[..., _T], *arguments: object) -> _T:
        """The value of ``work(*arguments)``, which changes nothing else: interrupted, it is done once more.

        The interrupt waits from then on. It gets through if one waits already, so that nobody is locked out.
        """
        try:
            return work(*arguments)
        except KeyboardInterrupt:
            if self.pending:
                raise
            self.pending = True
        return work(*arguments)

    def attempt(self, work: Callable[..., _T | None], *arguments: object) -> _T | None:
        """The value of ``work(*arguments)``, which one can do without: None if interrupted, also before."""
        try:
            self.check()
            return work(*arguments)
        except KeyboardInterrupt:
            return None

    def collect(self, begin: Callable[[], Iterable[_T]]) -> tuple[list[_T], bool]:
        """What ``begin()`` hands on, at least one, until interrupted; and whether it was.

        Interrupted before the first it begins once more, see :meth:`insist`. The interrupt waits, so that the first
        thing that is interruptible is to end at once.
        """
        items: list[_T] = []

        def gather() -> bool:
            try:
                items.extend(begin())
            except KeyboardInterrupt:
                if not items:
                    raise
                return True
            return False

        return items, self.insist(gather)

    def _hold(self) -> None:
        """Lets Ctrl-C wait, unless the program has its own idea of it, or another thread than the main one asks."""
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            with suppress(ValueError):  # an interpreter within another one has no signals
                signal.signal(signal.SIGINT, self._note)

    def _leave(self) -> None:
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) == self._note:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.pending:
            signal.default_int_handler(number, frame)
        self.pending = True


@contextmanager
def deferred_interrupts() -> Iterator[Interrupts]:
    """Lets Ctrl-C wait in its body, for :meth:`Interrupts.check` or the next thing that is interruptible.

    A second one while the first is waiting raises KeyboardInterrupt at once. One that still waits at the end came too
    late to change anything, and is forgotten. Within another such body it is the same as that. Outside the main thread,
    where signals do not arrive, and where a program has a handler of its own, that is left as it is; interrupts that
    are raised by functions are treated alike.
    """
    outer: Interrupts | None = getattr(_here, "interrupts", None)
    if outer is not None:
        yield outer
        return
    interrupts = Interrupts()
    try:
        interrupts._hold()
        _here.interrupts = interrupts
        yield interrupts
    finally:
        _here.interrupts = None
        interrupts._leave()
