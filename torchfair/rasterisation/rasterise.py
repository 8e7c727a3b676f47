"""Which triangle covers each pixel: a z-buffer in plain torch, exact to the pixel and deterministic."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ..errors import ShapeError
from .depth_keys import NO_KEY, depth_range, key_bits, levels_within, pack_keys, unpack_keys
from .scan import Spans, span_chunks, triangle_spans

_BAND = 1 << 16  # pixels worked on at a time on a CPU: keeps every temporary inside the cache


class Fragments(NamedTuple):
    """What :func:`rasterise` sees through every pixel; row 0 is the top row.

    Attributes:
        face_index: ``(height, width)`` int64, the nearest triangle, -1 where there is none.
        depth: ``(height, width)``, depth of that triangle at the pixel centre, infinite where there is none.
        barycentric: ``(height, width, 3)``, affine weights of its three corners at the pixel centre, zero where
            there is none. They sum to 1.
    """

    face_index: Tensor
    depth: Tensor
    barycentric: Tensor


def rasterise(points: Tensor, triangles: Tensor, width: int, height: int) -> Fragments:
    """Nearest triangle, its depth and barycentric weights at every pixel centre.

    Pixel ``(row j, column i)`` is the square ``[i, i+1] x [j, j+1]`` and is sampled at its centre. Triangles that
    share an edge never both cover a pixel along it and leave no gap. Both sides of a triangle are drawn. Equal
    depths (to ``2^-31`` of the depth range or less) go to the triangle with the smaller number, on every device.

    Depth and weights are differentiable with respect to ``points``; which triangle is seen is not (it is constant
    almost everywhere).

    Args:
        points: ``(V, 3)`` pixel coordinates ``x`` (right), ``y`` (down) and a depth that is affine over the
            screen and grows away from the eye: distance for parallel projection, ``-1 / distance`` for perspective.
        triangles: ``(T, 3)`` int64 point numbers. A triangle without area on the screen, or with a corner that is
            not finite, covers nothing.
        width: number of columns, at least 1.
        height: number of rows, at least 1.

    Raises:
        ShapeError: if an argument has another shape.
    """
    face_index = visible_triangles(points, triangles, width, height)
    barycentric, depth = interpolate(points, triangles, face_index)
    return Fragments(face_index, depth, barycentric)


def visible_triangles(
    points: Tensor,
    triangles: Tensor,
    width: int,
    height: int,
    *,
    pictures: Tensor | None = None,
    num_pictures: int | None = None,
) -> Tensor:
    """The ``face_index`` of :func:`rasterise` alone, for one picture or for several of the same size at once.

    Args:
        points: ``(V, 3)`` of all pictures.
        triangles: ``(T, 3)`` of all pictures.
        width: number of columns.
        height: number of rows.
        pictures: ``(T,)`` picture that each triangle is drawn in; with ``num_pictures`` the result is
            ``(num_pictures, height, width)``.
        num_pictures: number of pictures.
    """
    _check(points, triangles, width, height)
    shape = (height, width) if num_pictures is None else (num_pictures, height, width)
    nearest = torch.full((math.prod(shape),), NO_KEY, device=points.device)
    bits = key_bits(triangles.shape[0])
    parts = list(triangle_spans(points, triangles, width, height))
    in_pictures = [_pictures_of(spans, pictures) for spans in parts]
    origin, scale = _levels(parts, in_pictures, num_pictures or 1, bits)
    for spans, picture in zip(parts, in_pictures, strict=True):
        first_pixel = (picture * height + spans.row) * width + spans.start
        step = scale.index_select(0, picture)
        first_level, level_step = (spans.depth - origin.index_select(0, picture)) * step, spans.depth_step * step
        for span, offset in span_chunks(spans.length):
            level = first_level.index_select(0, span) + level_step.index_select(0, span) * offset
            key = pack_keys(level, spans.triangle.index_select(0, span), bits)
            nearest.scatter_reduce_(0, first_pixel.index_select(0, span) + offset, key, "amin")
    return unpack_keys(nearest, bits).view(shape)


def interpolate(points: Tensor, triangles: Tensor, face_index: Tensor) -> tuple[Tensor, Tensor]:
    """Barycentric weights ``(height, width, 3)`` and depth ``(height, width)`` of the triangles in ``face_index``.

    Differentiable with respect to ``points`` (V, 3), in pixels and depth, with ``triangles`` (T, 3) and ``face_index``
    (height, width) held fixed.
    """
    height, width = face_index.shape
    table = _affine_tables(points, triangles)
    x = torch.arange(width, device=points.device, dtype=points.dtype) + 0.5
    y = torch.arange(height, device=points.device, dtype=points.dtype) + 0.5
    bands = max(1, height * width // _BAND) if points.device.type == "cpu" else 1
    weights, depths = [], []
    for index, rows in zip(face_index.tensor_split(bands), y.tensor_split(bands), strict=True):
        seen = table.index_select(0, torch.where(index < 0, triangles.shape[0], index).view(-1))
        x0, y0, z0, x1, y1, z1, x2, y2, z2 = seen.view(*index.shape, 9).unbind(-1)
        dx, dy = x - x0, rows[:, None] - y0
        first, second = x1 * dx + y1 * dy, x2 * dx + y2 * dy
        covered = (index >= 0).to(points.dtype)
        weights.append(torch.stack([covered - first - second, first, second], dim=-1))
        depths.append(z0 + first * z1 + second * z2)
    return torch.cat(weights), torch.cat(depths)


def _affine_tables(points: Tensor, triangles: Tensor) -> Tensor:
    """One row ``(x0, y0, z0, x1, y1, z1, x2, y2, z2)`` for each triangle and a last one for the background.

    The weight of corner 1 is ``x1 (x - x0) + y1 (y - y0)``, that of corner 2 likewise, and the depth is
    ``z0 + weight1 z1 + weight2 z2``.
    """
    corners = points[triangles]
    origin, (a, b) = corners[:, 0], (corners[:, 1:] - corners[:, :1]).unbind(1)
    doubled_area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    flat = doubled_area == 0
    inverse = torch.where(flat, 0, 1 / torch.where(flat, 1, doubled_area))
    first = torch.stack([b[:, 1] * inverse, -b[:, 0] * inverse, a[:, 2]], dim=1)
    second = torch.stack([-a[:, 1] * inverse, a[:, 0] * inverse, b[:, 2]], dim=1)
    background = points.new_tensor([[0.0, 0, torch.inf, 0, 0, 0, 0, 0, 0]])
    return torch.cat([torch.cat([origin, first, second], dim=1), background])


def _pictures_of(spans: Spans, pictures: Tensor | None) -> Tensor:
    """(S,) picture of each span."""
    if pictures is None:
        return spans.triangle.new_zeros(()).expand_as(spans.triangle)
    return pictures.index_select(0, spans.triangle)


def _levels(parts: list[Spans], in_pictures: list[Tensor], num_pictures: int, bits: int) -> tuple[Tensor, Tensor]:
    """Origin and scale (pictures,) of the depth levels of all spans."""
    ranges = []
    for spans, picture in zip(parts, in_pictures, strict=True):
        last = spans.depth + spans.depth_step * (spans.length - 1)
        lower, upper = torch.minimum(spans.depth, last), torch.maximum(spans.depth, last)
        ranges.append(depth_range(lower, upper, picture, num_pictures))
    low, high = (torch.stack(ends) for ends in zip(*ranges, strict=True))
    return levels_within(low.amin(0), high.amax(0), bits)


def _check(points: Tensor, triangles: Tensor, width: int, height: int) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or not points.is_floating_point():
        raise ShapeError("points", "a floating tensor (V, 3)", f"{tuple(points.shape)} {points.dtype}")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.is_floating_point():
        raise ShapeError("triangles", "an integer tensor (T, 3)", f"{tuple(triangles.shape)} {triangles.dtype}")
    if width < 1 or height < 1:
        raise ShapeError("width and height", "at least one pixel each", (width, height))
