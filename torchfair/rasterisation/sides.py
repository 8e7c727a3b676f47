"""What is seen just beside edges, on either side."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from .depth_keys import NO_KEY, depth_levels, key_bits, pack_keys, unpack_keys
from .runs import run_chunks
from .segments import Segments
from .touch import TouchedSpans, touched_spans

STEP = 1e-6
"""Pixels from an edge to the places on its sides."""


class Places(NamedTuple):
    """Middles of segments ``(2, S)``, steps ``(2, S)`` to the second side, and their pixels ``(S,)`` in order."""

    middle: Tensor
    step: Tensor
    pixel: Tensor


class Tables(NamedTuple):
    """Triangles as functions of the place: three that are at least zero inside, and the depth level.

    Attributes:
        planes: (12, T), coefficients of x of the four functions, then of y, then constants.
        bounds: (2, T), least and largest level.
    """

    planes: Tensor
    bounds: Tensor


def seen_beside(
    corners: Tensor, pictures: Tensor, segments: Segments, ends: Tensor, shape: tuple[int, int, int]
) -> Tensor:
    """The nearest triangle on both sides of the middle of each segment: (S, 2), -1 where there is none.

    The second side is the one that ``(dy, -dx)`` points to, (dx, dy) being the direction of the edge. Places are
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
    nearest = torch.full((2, places.pixel.shape[0]), NO_KEY, device=corners.device)
    spans = touched_spans(corners[..., :2], shape[2], shape[1])
    tables = _tables(corners, pictures, shape[0], spans)
    for span, place in _meetings(spans, pictures, places.pixel, shape):
        keys = _keys(tables, spans.triangle.index_select(0, span), places, place)
        nearest.scatter_reduce_(1, place.expand(2, -1), keys, "amin")
    return unpack_keys(nearest, key_bits(corners.shape[0])).T


def _places(segments: Segments, ends: Tensor) -> Places:
    origin, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = torch.linalg.vector_norm(along, dim=-1, keepdim=True)
    across = torch.stack([along[:, 1], -along[:, 0]], dim=-1) * (STEP / torch.where(length > 0, length, 1))
    origin, along, across = (part.T.contiguous().index_select(1, segments.edge) for part in (origin, along, across))
    return Places(origin + along * ((segments.begin + segments.end) / 2), across, segments.pixel)


def _tables(corners: Tensor, pictures: Tensor, num_pictures: int, spans: TouchedSpans) -> Tables:
    x, y, z = corners.unbind(-1)
    touching = spans.triangle
    lower, upper = z.amin(1), z.amax(1)
    levels = depth_levels(lower[touching], upper[touching], pictures[touching], num_pictures, key_bits(z.shape[0]))
    origin, scale = (part.index_select(0, pictures)[:, None] for part in levels)
    level = (z - origin) * scale
    dx, dy = x.roll(-1, 1) - x, y.roll(-1, 1) - y
    doubled_area = dx[:, 0] * dy[:, 1] - dy[:, 0] * dx[:, 1]
    solid = doubled_area != 0
    inverse = torch.where(solid, 1 / torch.where(solid, doubled_area, 1), 0)[:, None]
    # The function of the edge from corner i is the barycentric weight of corner i - 1; without area it is -1.
    a, b = -dy * inverse, dx * inverse
    weights = a, b, torch.where(solid[:, None], -(a * x + b * y), -1)
    opposite = level.roll(1, 1)
    planes = torch.cat([torch.cat([w, (w * opposite).sum(1, keepdim=True)], dim=1) for w in weights], dim=1)
    bounds = torch.stack([level.amin(1), level.amax(1)])
    return Tables(planes.T.contiguous(), bounds)


def _meetings(
    spans: TouchedSpans, pictures: Tensor, pixel: Tensor, shape: tuple[int, int, int]
) -> Iterator[tuple[Tensor, Tensor]]:
    """Every pair of a span and a place in one of its pixels, once, in chunks ``(span, place)``."""
    num_pictures, height, width = shape
    counts = torch.bincount(pixel, minlength=num_pictures * height * width)
    first = torch.nn.functional.pad(counts.cumsum(0), (1, 0))  # place that each pixel begins with
    row = (pictures.index_select(0, spans.triangle) * height + spans.row) * width
    begin = first.index_select(0, row + spans.start)
    return run_chunks(begin, first.index_select(0, row + spans.stop) - begin)


def _keys(tables: Tables, triangle: Tensor, places: Places, place: Tensor) -> Tensor:
    """Depth level and number (2, n) of triangles on both sides of places, the largest key where they miss it."""
    a, b, c = tables.planes.index_select(1, triangle).view(3, 4, -1).unbind(0)
    x, y = places.middle.index_select(1, place)
    step_x, step_y = places.step.index_select(1, place)
    slopes = torch.addcmul(a * step_x, b, step_y)
    values = c.addcmul_(a, x).addcmul_(b, y)
    sides = torch.stack([values - slopes, values + slopes])
    inside = torch.minimum(torch.minimum(sides[:, 0], sides[:, 1]), sides[:, 2]) >= 0
    level = torch.clamp(sides[:, 3], *tables.bounds.index_select(1, triangle))
    return torch.where(inside, pack_keys(level, triangle, key_bits(tables.bounds.shape[1])), NO_KEY)
