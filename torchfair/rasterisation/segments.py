"""Edges on the screen, cut where they pass from one pixel into the next."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .runs import expand_counts


class Segments(NamedTuple):
    """Pieces of edges, each within one pixel, ordered by pixel.

    Attributes:
        edge: (S,) the edge each is part of.
        pixel: (S,) ``(picture * height + row) * width + column``.
        begin: (S,) float64 position along the edge where it begins, 0 to 1.
        end: (S,) position where it ends, at least ``begin``.
    """

    edge: Tensor
    pixel: Tensor
    begin: Tensor
    end: Tensor


def pixel_segments(ends: Tensor, pictures: Tensor, width: int, height: int) -> Segments:
    """Cuts edges with ``ends`` (E, 2, 2), float64 and finite, at the borders of pixels; drops what is off the screen.

    Args:
        ends: pixel coordinates of both ends of every edge.
        pictures: (E,) picture that each edge is part of.
        width: number of columns.
        height: number of rows.
    """
    origin, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    begin, end = _on_screen(origin, along, ends.new_tensor([width, height]))
    (columns, left), (rows, upper) = (_crossings(origin[:, axis], along[:, axis], begin, end) for axis in (0, 1))
    edge, start, stop = cut_items(begin, end, torch.cat([columns, rows]), torch.cat([left, upper]))
    middle = origin.index_select(0, edge) + ((start + stop) / 2)[:, None] * along.index_select(0, edge)
    column = middle[:, 0].floor().clamp(0, width - 1).to(torch.int64)
    row = middle[:, 1].floor().clamp(0, height - 1).to(torch.int64)
    pixel, order = ((pictures.index_select(0, edge) * height + row) * width + column).sort(stable=True)
    return Segments(edge[order], pixel, start[order], stop[order])


def cut_items(begin: Tensor, end: Tensor, item: Tensor, place: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Cuts intervals ``begin .. end`` (n,) at places (c,) of items (c,): item, begin and end of the pieces, in order.

    Items whose interval is empty are left out.
    """
    filled = torch.nonzero(end > begin).squeeze(1)
    number = torch.cat([filled, item])
    start = torch.cat([begin.index_select(0, filled), place])
    size = end - begin
    # Relative positions lie in 0..1: half of them beside the number of the item orders both at once.
    order = (number + 0.5 * (start - begin.index_select(0, number)) / size.index_select(0, number)).argsort(stable=True)
    number, start = number.index_select(0, order), start.index_select(0, order)
    last = torch.ones_like(number, dtype=torch.bool)
    last[:-1] = number[1:] != number[:-1]
    stop = torch.where(last, end.index_select(0, number), start.roll(-1))
    return number, start, torch.maximum(start, stop)


def _on_screen(origin: Tensor, along: Tensor, size: Tensor) -> tuple[Tensor, Tensor]:
    """Positions along each edge where it enters and leaves the screen; (1, 0) or the like if it misses it."""
    moving = along != 0
    inverse = 1 / torch.where(moving, along, 1)
    enter, leave = -origin * inverse, (size - origin) * inverse
    enter, leave = torch.minimum(enter, leave), torch.maximum(enter, leave)
    inside = (origin >= 0) & (origin <= size)
    enter = torch.where(moving, enter, torch.where(inside, 0.0, 2.0))
    leave = torch.where(moving, leave, torch.where(inside, 1.0, -1.0))
    return enter.amax(1).clamp(min=0), leave.amin(1).clamp(max=1)


def _crossings(origin: Tensor, along: Tensor, begin: Tensor, end: Tensor) -> tuple[Tensor, Tensor]:
    """Edge number and position of all crossings with lines at whole numbers strictly between begin and end."""
    first, last = origin + begin * along, origin + end * along
    low, high = torch.minimum(first, last), torch.maximum(first, last)
    line = low.floor() + 1
    count = torch.where((end > begin) & (along != 0), (high.ceil() - line).clamp(min=0), 0).to(torch.int64)
    edge, number = expand_counts(count)
    at = (line.index_select(0, edge) + number - origin.index_select(0, edge)) / along.index_select(0, edge)
    return edge, torch.minimum(torch.maximum(at, begin.index_select(0, edge)), end.index_select(0, edge))
