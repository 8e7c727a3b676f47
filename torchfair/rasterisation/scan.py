"""Scan conversion: triangles on the screen as horizontal runs of covered pixels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from .runs import expand_counts, run_chunks

_TRIANGLES = 1 << 18  # scanned at a time on a CPU: most of a large mesh cover no pixel
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


def triangle_spans(points: Tensor, triangles: Tensor, width: int, height: int) -> Spans:
    r"""The runs of pixels whose centres lie in each triangle, clipped to the screen.

    A run is half-open, from the left edge to the right edge; rows are half-open from top to bottom. Crossings of
    an edge are computed from its two points in a fixed order, so triangles that share the edge agree on them to
    the last bit, and every pixel centre on it belongs to exactly one of them::

            /\        row centre y: left = crossing of one edge, right = crossing of the other,
        ---x--x---    pixels ceil(left - 1/2) .. ceil(right - 1/2) - 1
          /____\
    """
    portion = _TRIANGLES if triangles.is_cpu else max(triangles.shape[0], 1)
    some = enumerate(torch.split(triangles, portion))
    parts = [_spans(points, chosen, number * portion, width, height) for number, chosen in some]
    return parts[0] if len(parts) == 1 else Spans(*(torch.cat(columns) for columns in zip(*parts, strict=True)))


def _spans(points: Tensor, triangles: Tensor, before: int, width: int, height: int) -> Spans:
    """Those of some triangles, of which so many come before."""
    corners = points.detach()[triangles].to(torch.float64)
    corners = torch.where(torch.isfinite(corners).all(-1).all(-1)[:, None, None], corners, 0)
    (left_end, top), (right_end, bottom) = (
        (_first_centre(x, width), _first_centre(y, height))
        for x, y in ((_least(corners, 0) - _SLACK, _least(corners, 1)), (_most(corners, 0) + _SLACK, _most(corners, 1)))
    )
    chosen = torch.nonzero((bottom > top) & (right_end > left_end)).squeeze(1)
    corners, top, bottom = corners[chosen], top[chosen], bottom[chosen]
    triangle, offset = expand_counts(bottom - top)
    row = top[triangle] + offset
    left, right = _crossings(corners, triangle, row.to(torch.float64) + 0.5)
    start, stop = _first_centre(left, width), _first_centre(right, width)
    filled = stop > start
    triangle, row, start, stop = triangle[filled], row[filled], start[filled], stop[filled]
    depth, step = _depths(corners, triangle, row, start, stop)
    return Spans(chosen[triangle] + before, row, start, stop - start, depth, step)


def span_chunks(spans: Spans) -> Iterator[tuple[Tensor, Tensor]]:
    """Every covered pixel once, in chunks ``(span number, pixels after the start of the span)``."""
    return run_chunks(torch.zeros_like(spans.length), spans.length, _CHUNK)


def _first_centre(coordinate: Tensor, size: int) -> Tensor:
    """Number of the first pixel whose centre is at or beyond ``coordinate``, within ``0 .. size``."""
    return (coordinate - 0.5).ceil().clamp(0, size).to(torch.int64)


def _least(corners: Tensor, axis: int) -> Tensor:
    """Least coordinate of triangles (T, 3, 3): pairs at once are faster than a minimum over so few."""
    a, b, c = corners[..., axis].unbind(1)
    return torch.minimum(torch.minimum(a, b), c)


def _most(corners: Tensor, axis: int) -> Tensor:
    a, b, c = corners[..., axis].unbind(1)
    return torch.maximum(torch.maximum(a, b), c)


def _crossings(corners: Tensor, triangle: Tensor, centre: Tensor) -> tuple[Tensor, Tensor]:
    """Where the horizontal line at ``centre`` enters and leaves each triangle; empty (inf, -inf) if it misses."""
    first, second = corners, corners.roll(-1, 1)
    swap = (second[..., 1] < first[..., 1])[..., None]
    upper, lower = torch.where(swap, second, first), torch.where(swap, first, second)
    rise = lower[..., 1] - upper[..., 1]
    slope = (lower[..., 0] - upper[..., 0]) / torch.where(rise > 0, rise, 1)
    left = torch.full_like(centre, torch.inf)
    right = torch.full_like(centre, -torch.inf)
    for edge in range(3):
        top, bottom = upper[:, edge, 1][triangle], lower[:, edge, 1][triangle]
        x = upper[:, edge, 0][triangle] + (centre - top) * slope[:, edge][triangle]
        crossed = (top <= centre) & (centre < bottom)
        left = torch.where(crossed, torch.minimum(left, x), left)
        right = torch.where(crossed, torch.maximum(right, x), right)
    return left, right


def _depths(corners: Tensor, triangle: Tensor, row: Tensor, start: Tensor, stop: Tensor) -> tuple[Tensor, Tensor]:
    """Depth at the first pixel of each span and its step, never outside the depths of the triangle's corners."""
    origin = corners[:, 0]
    a, b = corners[:, 1] - origin, corners[:, 2] - origin
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    safe = torch.where(area != 0, area, 1)
    slope_x = torch.where(area != 0, a[:, 2] * b[:, 1] - a[:, 1] * b[:, 2], 0) / safe
    slope_y = torch.where(area != 0, a[:, 0] * b[:, 2] - a[:, 2] * b[:, 0], 0) / safe
    at_row = (origin[:, 2] + (0.5 - origin[:, 1]) * slope_y + (0.5 - origin[:, 0]) * slope_x)[triangle]
    at_row = at_row + row * slope_y[triangle]
    nearest, farthest = _least(corners, 2)[triangle], _most(corners, 2)[triangle]
    across = slope_x[triangle]
    first = torch.clamp(at_row + start * across, nearest, farthest)
    last = torch.clamp(at_row + (stop - 1) * across, nearest, farthest)
    return first, (last - first) / (stop - start - 1).clamp(min=1)
