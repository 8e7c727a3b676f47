"""Runs of whole numbers, one after the other, without a loop."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]


def ranges(starts: Ints, sizes: Ints) -> Ints:
    """The numbers ``start, ..., start + size - 1`` of every pair, one after the other."""
    before = np.cumsum(sizes) - sizes
    return np.repeat(starts - before, sizes) + np.arange(int(sizes.sum()))
