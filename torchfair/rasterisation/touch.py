"""Conservative scan conversion: all pixels that triangles touch, not only those whose centre they cover."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .runs import expand_counts

_MARGIN = 1e-2  # pixels by which triangles are enlarged


class TouchedSpans(NamedTuple):
    """Runs of pixels: triangle ``triangle`` touches at most the columns ``start .. stop - 1`` of row ``row``.

    All have shape (S,), ordered by triangle, then row.
    """

    triangle: Tensor
    row: Tensor
    start: Tensor
    stop: Tensor


def touched_spans(corners: Tensor, width: int, height: int) -> TouchedSpans:
    """Runs of pixels that triangles with ``corners`` (T, 3, 2), enlarged by a hundredth of a pixel, touch.

    Args:
        corners: float64 pixel coordinates, finite.
        width: number of columns.
        height: number of rows.
    """
    x, y = corners.unbind(-1)
    top = (y.amin(1) - _MARGIN).floor().clamp(0, height).to(torch.int64)
    bottom = (y.amax(1) + _MARGIN).floor().clamp(-1, height - 1).to(torch.int64) + 1
    triangle, offset = expand_counts((bottom - top).clamp(min=0))
    row = top.index_select(0, triangle) + offset
    low, high = _extent(x, y, triangle, row)
    start = (low - _MARGIN).floor().clamp(0, width).to(torch.int64)
    stop = (high + _MARGIN).floor().clamp(-1, width - 1).to(torch.int64) + 1
    touched = torch.nonzero(stop > start).squeeze(1)
    return TouchedSpans(*(part.index_select(0, touched) for part in (triangle, row, start, stop)))


def _extent(x: Tensor, y: Tensor, triangle: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
    """Least and largest x of each triangle within its row of pixels; empty (inf, -inf) if it misses the row."""
    upper, lower = row - _MARGIN, row + (1 + _MARGIN)
    low = torch.full_like(upper, torch.inf)
    high = torch.full_like(upper, -torch.inf)
    for first in range(3):
        x0, y0 = x[:, first], y[:, first]
        rise, run = y[:, first - 2] - y0, x[:, first - 2] - x0
        steep = rise != 0
        inverse = torch.where(steep, 1 / torch.where(steep, rise, 1), torch.inf)
        y0, x0, inverse, run = (part.index_select(0, triangle) for part in (y0, x0, inverse, run))
        # A level edge lies in the row as a whole, or its two quotients are infinite with the same sign (or NaN).
        enter, leave = (upper - y0) * inverse, (lower - y0) * inverse
        enter, leave = torch.minimum(enter, leave), torch.maximum(enter, leave)
        met = (leave >= 0) & (enter <= 1)
        ends = x0 + run * enter.clamp(0, 1), x0 + run * leave.clamp(0, 1)
        low = torch.where(met, torch.minimum(low, torch.minimum(*ends)), low)
        high = torch.where(met, torch.maximum(high, torch.maximum(*ends)), high)
    return low, high
