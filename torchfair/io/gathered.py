"""Rows that come in portions, put into one array as they come."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

_MORE = 1.25  # times what was expected, where that turns out to be too few


class Gathered:
    """Arrays (n, ...) that follow each other, without a second copy of them all at the end."""

    def __init__(self) -> None:
        self._rows: npt.NDArray[Any] = np.zeros(0)
        self._count = 0

    def add(self, rows: npt.NDArray[Any], expected: float) -> None:
        """Appends rows; ``expected`` is how many there will be in all, as far as is known."""
        needed = self._count + len(rows)
        if not self._count:
            self._rows = np.empty((max(int(expected), needed), *rows.shape[1:]), rows.dtype)
        elif needed > len(self._rows):
            more = np.empty((int(_MORE * needed) - self._count, *rows.shape[1:]), rows.dtype)
            self._rows = np.concatenate([self._rows[: self._count], more])
        self._rows[self._count : needed] = rows
        self._count = needed

    @property
    def rows(self) -> npt.NDArray[Any]:
        """All of them."""
        return self._rows[: self._count]
