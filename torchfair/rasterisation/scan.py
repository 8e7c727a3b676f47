"""Scan conversion: triangles on the screen as horizontal runs of covered pixels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from .runs import expand_counts, run_chunks

_TRIANGLES = 1 << 16  # scanned at a time on a CPU: most of a large mesh cover no pixel
_SLACK = 1e-6  # pixels: far above the rounding of crossings, which may lie outside of their triangle by it
_CHUNK = 1 << 17  # pixels handed out at a time on a CPU: keeps every temporary inside the cache


class Spans(NamedTuple):
    """Runs of covered pixels: triangle ``triangle`` covers columns ``start .. start + length - 1`` of row ``row``.

    All have shape (S,), ordered by triangle, then row. Depths are float64.
    """

    triangle: Tensor
    row: Tensor
    start: Tensor
    length: Tensor
    depth: Tensor  # at the centre of the first pixel
    depth_step: Tensor  # from one pixel to the next


def triangle_spans(points: Tensor, triangles: Tensor, width: int, height: int) -> Iterator[Spans]:
    r"""The runs of pixels whose centres lie in each triangle, clipped to the screen.

    Of some triangles after the other, in one part at least: pieces that are small stay in the cache and can be used
    again, where runs of a large mesh in one piece are pages that the system has to clear.

    A run is half-open, from the left edge to the right edge; rows are half-open from top to bottom. Crossings of
    an edge are computed from its two points in a fixed order, so triangles that share the edge agree on them to
    the last bit, and every pixel centre on it belongs to exactly one of them::

            /\        row centre y: left = crossing of one edge, right = crossing of the other,
        ---x--x---    pixels ceil(left - 1/2) .. ceil(right - 1/2) - 1
          /____\
    """
    portion = _TRIANGLES if triangles.is_cpu else max(triangles.shape[0], 1)
    screen = _Screen.of(points, width, height)
    for number, chosen in enumerate(torch.split(triangles, portion)):
        yield _spans(screen, chosen, number * portion)


class _Screen(NamedTuple):
    """Points of a picture, coordinate by coordinate, each one's first row and columns, worked out once.

    Attributes:
        place: x, y and depth (P,) of each, float64.
        left: (P,) first column at or beyond x less some slack, int32 as all numbers of pixels here.
        right: (P,) the same with x and that slack.
        row: (P,) first row at or beyond y.
        usable: (P,) whether all three are finite; None if that is so of all points.
        width: of the picture.
    """

    place: tuple[Tensor, Tensor, Tensor]
    left: Tensor
    right: Tensor
    row: Tensor
    usable: Tensor | None
    width: int

    @classmethod
    def of(cls, points: Tensor, width: int, height: int) -> _Screen:
        """With points (P, 3)."""
        x, y, depth = points.detach().to(torch.float64).T.contiguous().unbind(0)
        usable = torch.isfinite(x) & torch.isfinite(y) & torch.isfinite(depth)
        every = bool(usable.all())
        if not every:
            x, y, depth = (torch.where(usable, part, 0) for part in (x, y, depth))
        left, right, row = (
            first_centre(part, size).to(torch.int32)
            for part, size in ((x - _SLACK, width), (x + _SLACK, width), (y, height))
        )
        return cls((x, y, depth), left, right, row, None if every else usable, width)


def _spans(screen: _Screen, triangles: Tensor, before: int) -> Spans:
    """Those of some triangles, of which so many come before."""
    corners = triangles.T.contiguous().unbind(0)
    tops = [screen.row.index_select(0, corner) for corner in corners]
    top, bottom = _least(*tops), _most(*tops)
    left_end = _least(*(screen.left.index_select(0, corner) for corner in corners))
    right_end = _most(*(screen.right.index_select(0, corner) for corner in corners))
    may_cover = (bottom > top) & (right_end > left_end)
    if screen.usable is not None:
        may_cover &= screen.usable[triangles].all(1)
    chosen = torch.nonzero(may_cover).squeeze(1)
    kept = [corner.index_select(0, chosen) for corner in corners]
    top, bottom = (end.index_select(0, chosen).to(torch.int64) for end in (top, bottom))
    x, y, depth = ([part.index_select(0, corner) for corner in kept] for part in screen.place)
    triangle, offset = expand_counts(bottom - top)
    row = top.index_select(0, triangle) + offset
    left, right = _crossings(x, y, triangle, row.to(torch.float64) + 0.5)
    start, stop = first_centre(left, screen.width), first_centre(right, screen.width)
    filled = torch.nonzero(stop > start).squeeze(1)
    triangle, row, start, stop = (part.index_select(0, filled) for part in (triangle, row, start, stop))
    first, step = _depths(x, y, depth, triangle, row, start, stop)
    return Spans(chosen.index_select(0, triangle) + before, row, start, stop - start, first, step)


def span_chunks(length: Tensor, begin: Tensor | None = None) -> Iterator[tuple[Tensor, Tensor]]:
    """Every pixel of spans of some lengths (S,) once, in chunks ``(span number, pixels after the start of the span)``.

    With the numbers ``begin`` (S,) of first pixels, the numbers of pixels.
    """
    return run_chunks(torch.zeros_like(length) if begin is None else begin, length, _CHUNK)


def first_centre(coordinate: Tensor, size: int) -> Tensor:
    """Number of the first pixel whose centre is at or beyond ``coordinate``, within ``0 .. size``."""
    return (coordinate - 0.5).ceil().clamp(0, size).to(torch.int64)


def _least(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    """Least of three: pairs at once are faster than a minimum over so few."""
    return torch.minimum(torch.minimum(a, b), c)


def _most(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    """Largest of three."""
    return torch.maximum(torch.maximum(a, b), c)


def _crossings(x: list[Tensor], y: list[Tensor], triangle: Tensor, centre: Tensor) -> tuple[Tensor, Tensor]:
    """Where the horizontal lines at ``centre`` (S,) enter and leave triangles, between their corners up and down.

    Args:
        x: (T,) of each of three corners.
        y: (T,) of each of them.
        triangle: (S,) that each line meets.
        centre: (S,) from the top of that triangle on, above its bottom.
    """
    (x0, y0), (x1, y1), (x2, y2) = _downwards(x, y)
    long, upper, lower = slope(x0, y0, x2, y2), slope(x0, y0, x1, y1), slope(x1, y1, x2, y2)
    x0, y0, x1, y1, long, upper, lower = (
        part.index_select(0, triangle) for part in (x0, y0, x1, y1, long, upper, lower)
    )
    down = centre - y0
    one = x0 + down * long
    other = torch.where(centre < y1, x0 + down * upper, x1 + (centre - y1) * lower)
    return torch.minimum(one, other), torch.maximum(one, other)


def _downwards(x: list[Tensor], y: list[Tensor]) -> list[tuple[Tensor, Tensor]]:
    """Three points of every triangle, in the order of y."""
    points = list(zip(x, y, strict=True))
    for i, j in ((0, 1), (1, 2), (0, 1)):
        (ax, ay), (bx, by) = points[i], points[j]
        swap = by < ay
        points[i] = torch.where(swap, bx, ax), torch.where(swap, by, ay)
        points[j] = torch.where(swap, ax, bx), torch.where(swap, ay, by)
    return points


def slope(x0: Tensor, y0: Tensor, x1: Tensor, y1: Tensor) -> Tensor:
    """Step in x for one down along edges; of no use for level ones, which no line crosses."""
    rise = y1 - y0
    return (x1 - x0) / torch.where(rise > 0, rise, 1)


def _depths(
    x: list[Tensor], y: list[Tensor], z: list[Tensor], triangle: Tensor, row: Tensor, start: Tensor, stop: Tensor
) -> tuple[Tensor, Tensor]:
    """Depth at the first pixel of each span and its step, never outside the depths of the triangle's corners."""
    (ax, ay, az), (bx, by, bz) = ((x[k] - x[0], y[k] - y[0], z[k] - z[0]) for k in (1, 2))
    area = ax * by - ay * bx
    known = area != 0
    safe = torch.where(known, area, 1)
    slope_x = torch.where(known, az * by - ay * bz, 0) / safe
    slope_y = torch.where(known, ax * bz - az * bx, 0) / safe
    at_top = z[0] + (0.5 - y[0]) * slope_y + (0.5 - x[0]) * slope_x
    at_top, down, across, nearest, farthest = (
        part.index_select(0, triangle) for part in (at_top, slope_y, slope_x, _least(*z), _most(*z))
    )
    at_row = at_top + row * down
    first = torch.clamp(at_row + start * across, nearest, farthest)
    last = torch.clamp(at_row + (stop - 1) * across, nearest, farthest)
    return first, (last - first) / (stop - start - 1).clamp(min=1)
