"""What is seen just beside edges, on either side."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from .rasterise import depth_levels, unpack_nearest
from .scan import expand_counts
from .segments import Segments
from .touch import TouchedSpans, touched_spans

STEP = 1e-3
"""Pixels from an edge to the places on its sides."""

_CHUNK = 1 << 15  # tests worked on at a time on a CPU: keeps every temporary inside the cache
_FAR = torch.iinfo(torch.int64).max


class Places(NamedTuple):
    """Middles of segments ``(S, 2)``, steps ``(S, 2)`` to the side, and their pixels ``(S,)`` in ascending order."""

    middle: Tensor
    step: Tensor
    pixel: Tensor


def seen_beside(
    corners: Tensor, pictures: Tensor, segments: Segments, ends: Tensor, shape: tuple[int, int, int]
) -> Tensor:
    """The nearest triangle on both sides of the middle of each segment: (S, 2), -1 where there is none.

    The first side is where ``(dy, -dx)`` points away from, (dx, dy) being the direction of the edge. Places are
    :data:`STEP` pixels off the edge and tested against every triangle that touches the pixel, so triangles smaller
    than a pixel are found too. Equal depths go to the triangle with the smaller number.

    Args:
        corners: (T, 3, 3) pixel coordinates and depth of triangles, float64, finite.
        pictures: (T,) picture that each triangle is drawn in.
        segments: pieces of edges.
        ends: (E, 2, 2) pixel coordinates of the ends of the edges, float64.
        shape: number of pictures, height, width.
    """
    places = _places(segments, ends)
    nearest = torch.full((places.pixel.shape[0], 2), _FAR, device=corners.device)
    spans = touched_spans(corners[..., :2], shape[2], shape[1])
    table = _tables(corners, pictures, shape[0], spans)
    for span, place in _meetings(spans, pictures, places.pixel, shape):
        triangle = spans.triangle.index_select(0, span)
        key = _keys(table.index_select(0, triangle), places, place, triangle)
        nearest.scatter_reduce_(0, place[:, None].expand(-1, 2), key, "amin")
    return unpack_nearest(nearest)


def _places(segments: Segments, ends: Tensor) -> Places:
    origin, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = torch.linalg.vector_norm(along, dim=-1, keepdim=True)
    across = torch.stack([along[:, 1], -along[:, 0]], dim=-1) * (STEP / torch.where(length > 0, length, 1))
    position = ((segments.begin + segments.end) / 2)[:, None]
    middle = origin.index_select(0, segments.edge) + position * along.index_select(0, segments.edge)
    return Places(middle, across.index_select(0, segments.edge), segments.pixel)


def _tables(corners: Tensor, pictures: Tensor, num_pictures: int, spans: TouchedSpans) -> Tensor:
    """One row of 14 for each triangle: three edge functions and the depth level as (x, y, 1), least and largest level.

    A place lies in the triangle where all three edge functions are at least zero.
    """
    x, y, z = corners.unbind(-1)
    touching = spans.triangle
    lower, upper = z.amin(1), z.amax(1)
    levels = depth_levels(lower[touching], upper[touching], pictures[touching], num_pictures)
    origin, scale = (part.index_select(0, pictures)[:, None] for part in levels)
    level = (z - origin) * scale
    dx, dy = x.roll(-1, 1) - x, y.roll(-1, 1) - y
    doubled_area = dx[:, 0] * dy[:, 1] - dy[:, 0] * dx[:, 1]
    solid = doubled_area != 0
    inverse = torch.where(solid, 1 / torch.where(solid, doubled_area, 1), 0)
    # The function of the edge from corner i is the barycentric weight of corner i - 1; without area it is -1.
    a, b = -dy * inverse[:, None], dx * inverse[:, None]
    c = torch.where(solid[:, None], -(a * x + b * y), -1)
    opposite = level.roll(1, 1)
    planes = torch.stack([a, b, c], dim=-1)
    depth = (planes * opposite[..., None]).sum(1)
    bounds = torch.stack([level.amin(1), level.amax(1)], dim=-1)
    return torch.cat([planes.flatten(1), depth, bounds], dim=1)


def _meetings(
    spans: TouchedSpans, pictures: Tensor, pixel: Tensor, shape: tuple[int, int, int]
) -> Iterator[tuple[Tensor, Tensor]]:
    """Every pair of a span and a place in one of its pixels, once, in chunks ``(span, place)``."""
    num_pictures, height, width = shape
    counts = torch.bincount(pixel, minlength=num_pictures * height * width)
    first = torch.nn.functional.pad(counts.cumsum(0), (1, 0))  # place that each pixel begins with
    row = (pictures.index_select(0, spans.triangle) * height + spans.row) * width
    begin = first.index_select(0, row + spans.start)
    number = first.index_select(0, row + spans.stop) - begin
    chosen = torch.nonzero(number).squeeze(1)
    begin, number = begin.index_select(0, chosen), number.index_select(0, chosen)
    ends = number.cumsum(0)
    total = int(ends[-1]) if ends.shape[0] else 0
    size = _CHUNK if pixel.device.type == "cpu" else max(total, 1)
    marks = torch.arange(size, max(total, size), size, device=pixel.device)
    cuts = [0, *torch.searchsorted(ends, marks).tolist(), ends.shape[0]]
    for low, high in itertools.pairwise(cuts):
        if high > low:
            item, offset = expand_counts(number[low:high])
            yield chosen[low:high].index_select(0, item), begin[low:high].index_select(0, item) + offset


def _keys(table: Tensor, places: Places, place: Tensor, triangle: Tensor) -> Tensor:
    """Depth level and number (n, 2) of triangles on both sides of places, or the largest key where they miss it."""
    x, y = places.middle.index_select(0, place).unbind(-1)
    step_x, step_y = places.step.index_select(0, place).unbind(-1)
    columns = table.unbind(-1)
    values, slopes = [], []
    for a, b, c in (columns[0:3], columns[3:6], columns[6:9], columns[9:12]):
        values.append(a * x + b * y + c)
        slopes.append(a * step_x + b * step_y)
    sides = []
    for sign in (-1, 1):
        first, second, third, level = (value + sign * slope for value, slope in zip(values, slopes, strict=True))
        inside = torch.minimum(torch.minimum(first, second), third) >= 0
        level = torch.minimum(torch.maximum(level, columns[12]), columns[13])
        sides.append(torch.where(inside, (level.to(torch.int64) << 32) | triangle, _FAR))
    return torch.stack(sides, dim=-1)
