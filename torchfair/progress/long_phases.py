"""Phases that take long: words that are shown after a while, for as long as a phase goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

PATIENCE = 2.0
"""Seconds before a phase is shown."""


class LongPhases:
    """A listener (see :func:`~torchfair.progress.listening`) that shows phases once they take long.

    Args:
        show: Called in a thread of its own with the words of a phase and the seconds since it began or came back.
        patience: Seconds before the first time.
        refresh: Seconds between this and the next time; once only if None.
    """

    def __init__(
        self, show: Callable[[str, float], object], *, patience: float = PATIENCE, refresh: float | None = None
    ) -> None:
        self._show, self._patience, self._refresh = show, patience, refresh
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def __call__(self, words: str) -> None:
        """A phase begins; "" if none does. The one before is shown no more."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if words:
            self._ended = threading.Event()
            self._thread = threading.Thread(target=self._wait, args=(words, self._ended), daemon=True)
            self._thread.start()

    def _wait(self, words: str, ended: threading.Event) -> None:
        start, pause = time.monotonic(), self._patience
        while not ended.wait(pause):
            self._show(words, time.monotonic() - start)
            if self._refresh is None:
                return
            pause = self._refresh
