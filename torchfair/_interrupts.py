"""Ctrl-C that loses nothing: it waits until the work at hand is done, and acts at once where it may."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, TypeVar

_T = TypeVar("_T")
_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
_here = threading.local()  # the interrupts that wait in this thread


class Interrupts:
    """What has become of Ctrl-C while :func:`deferred_interrupts` is in force.

    Attributes:
        pending: Whether one is waiting.
    """

    def __init__(self) -> None:
        self.pending = False
        self._before: dict[int, Any] = {}

    def check(self) -> None:
        """Raises KeyboardInterrupt if one is waiting, which it then no longer is."""
        if self.taken():
            raise KeyboardInterrupt

    def taken(self) -> bool:
        """Whether one is waiting, which it then no longer is: whoever asks ends what is going on."""
        waited, self.pending = self.pending, False
        return waited

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
        if threading.current_thread() is not threading.main_thread():
            return
        for number in (signal.SIGINT, *_ENDING):
            handler = signal.getsignal(number)
            if handler is signal.default_int_handler or isinstance(handler, LikeCtrlC):
                with suppress(ValueError):  # an interpreter within another one has no signals
                    signal.signal(number, self._note)
                    self._before[number] = handler

    def _leave(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        for number, handler in self._before.items():
            if signal.getsignal(number) == self._note:
                signal.signal(number, handler)
        self._before = {}

    def _note(self, number: int, frame: FrameType | None) -> None:
        handler = self._before.get(number)
        if isinstance(handler, LikeCtrlC):
            handler.number = number
        if self.pending:
            raise KeyboardInterrupt
        self.pending = True


def was_interrupted(error: ImportError) -> bool:
    """Whether Ctrl-C made an import fail: modules written in C say so by an error that has it for a cause."""
    cause: BaseException | None = error
    while isinstance(cause, ImportError):
        cause = cause.__cause__ or cause.__context__
    return isinstance(cause, KeyboardInterrupt)


class LikeCtrlC:
    """A handler of signals that end programs: they raise KeyboardInterrupt, which waits where that of Ctrl-C waits.

    Attributes:
        number: Of the last signal that came; None if none has.
    """

    def __init__(self) -> None:
        self.number: int | None = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.number = number
        raise KeyboardInterrupt


@contextmanager
def ended_like_ctrl_c() -> Iterator[LikeCtrlC]:
    """SIGTERM and SIGHUP (a terminal that is closed) act as Ctrl-C does in its body.

    Where they are ignored, or the program has handlers of its own, and outside the main thread, that is left as it is.
    """
    handler, changed = LikeCtrlC(), []
    if threading.current_thread() is threading.main_thread():
        for number in _ENDING:
            if signal.getsignal(number) is signal.SIG_DFL:
                with suppress(ValueError):
                    signal.signal(number, handler)
                    changed.append(number)
    try:
        yield handler
    finally:
        for number in changed:
            signal.signal(number, signal.SIG_DFL)


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
