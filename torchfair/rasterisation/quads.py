"""Scan conversion of parallelograms: one run of pixels for each row, where two triangles would take two."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .runs import expand_counts
from .scan import first_centre, slope


class QuadSpans(NamedTuple):
    """Runs of pixels: quad ``quad`` covers columns ``start .. start + length - 1`` of row ``row``.

    All have shape (S,), ordered by quad, then row.
    """

    quad: Tensor
    row: Tensor
    start: Tensor
    length: Tensor


def parallelogram_spans(x: Tensor, y: Tensor, width: int, height: int) -> QuadSpans:
    """The runs of pixels whose centres lie in each parallelogram, clipped to the screen.

    Half-open and with the crossings of edges as :func:`~torchfair.rasterisation.scan.triangle_spans` has them, so of
    the two triangles of a parallelogram these are the runs, joined.

    Args:
        x: (4, n) pixel coordinates of the corners, one after the other around it, float64, finite.
        y: (4, n) of the corners, down.
        width: number of columns.
        height: number of rows.
    """
    x, y = _from_the_top(x, y)
    begin = first_centre(y[0], height)
    quad, offset = expand_counts(first_centre(torch.maximum(y[2], torch.maximum(y[1], y[3])), height) - begin)
    row = begin.index_select(0, quad) + offset
    centre = row.to(torch.float64) + 0.5
    one, other = (_chain(x, y, corner, quad, centre) for corner in (1, 3))
    start = first_centre(torch.minimum(one, other), width)
    stop = first_centre(torch.maximum(one, other), width)
    filled = torch.nonzero(stop > start).squeeze(1)
    quad, row, start, stop = (part.index_select(0, filled) for part in (quad, row, start, stop))
    return QuadSpans(quad, row, start, stop - start)


def _from_the_top(x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    """Corners (4, n) in the same order, the first of the highest ones first: halves, then quarters change places."""
    lower = torch.minimum(y[2], y[3]) < torch.minimum(y[0], y[1])
    x, y = (torch.where(lower, part.roll(2, 0), part) for part in (x, y))
    lower = y[1] < y[0]
    x, y = (torch.where(lower, part.roll(-1, 0), part) for part in (x, y))
    return x, y


def _chain(x: Tensor, y: Tensor, corner: int, quad: Tensor, centre: Tensor) -> Tensor:
    """(S,) where level lines at ``centre`` meet the two edges from the top of their quad past a corner to its foot."""
    upper, lower = slope(x[0], y[0], x[corner], y[corner]), slope(x[corner], y[corner], x[2], y[2])
    x0, y0, x1, y1, upper, lower = (
        part.index_select(0, quad) for part in (x[0], y[0], x[corner], y[corner], upper, lower)
    )
    return torch.where(centre < y1, x0 + (centre - y0) * upper, x1 + (centre - y1) * lower)
