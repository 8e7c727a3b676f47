"""How long an iteration may still take."""

from __future__ import annotations

from collections import deque

_REMEMBERED = 11


class TimeLeft:
    """Upper estimate of the time until ``max_iterations``: the mean duration of the last ten, times those left.

    A solver that converges earlier needs less, so the number is an upper estimate as long as iterations do not
    become slower. A record with a lower iteration number than the one before starts afresh.
    """

    def __init__(self, max_iterations: int) -> None:
        self._max_iterations = max_iterations
        self._seen: deque[tuple[int, float]] = deque(maxlen=_REMEMBERED)

    def observe(self, iteration: int, elapsed: float) -> None:
        """Takes note that ``iteration`` ended ``elapsed`` seconds after the start."""
        if self._seen and iteration < self._seen[-1][0]:
            self._seen.clear()
        self._seen.append((iteration, elapsed))

    def seconds(self) -> float | None:
        """Seconds left; None until two iterations are known."""
        if not self._seen or self._seen[-1][0] == self._seen[0][0]:
            return None
        (first, start), (last, end) = self._seen[0], self._seen[-1]
        return max(0.0, (end - start) / (last - first) * max(0, self._max_iterations - last))


def duration(seconds: float) -> str:
    """Such as ``0.4 s``, ``12 s``, ``3 min 05 s``, ``2 h 07 min``."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
