"""Short edges that are seen or hidden as a whole, told by the pixels around them without looking at single points."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..cameras.camera import Camera

_LEVELS = 3  # squares of 2, 4 and 8 pixels
_ROUNDINGS = 64  # of the largest coordinate: more than interpolating and projecting a point adds up to


class DepthLimits(NamedTuple):
    """Depths that decide for all points in a square of pixels; for every square of some sizes, smallest first.

    Attributes:
        seen: (levels H W,) whatever is not behind it is seen, in any pixel of the square.
        hidden: (levels H W,) whatever is behind it is hidden.
        shape: (H, W).
    """

    seen: Tensor
    hidden: Tensor
    shape: tuple[int, int]

    @classmethod
    def of(cls, nearest: Tensor, farthest: Tensor) -> DepthLimits:
        """With the least and the largest depth (H, W) up to which points may be seen in a pixel."""
        seen, hidden = [nearest], [farthest]
        for level in range(_LEVELS):
            step = 1 << level
            seen.append(_pairs(_pairs(seen[-1], step, 0, False), step, 1, False))
            hidden.append(_pairs(_pairs(hidden[-1], step, 0, True), step, 1, True))
        height, width = nearest.shape
        return cls(torch.stack(seen[1:]).view(-1), torch.stack(hidden[1:]).view(-1), (height, width))

    def told(self, ends: BoxedPoints, edges: Tensor) -> tuple[Tensor, Tensor]:
        """Which of the edges (E, 2) are seen in all their points, and which are told: seen or hidden as a whole."""
        first, second = edges.unbind(1)
        height, width = self.shape
        left, top = (torch.minimum(*_both(part, first, second)) for part in (ends.left, ends.top))
        right, bottom = (torch.maximum(*_both(part, first, second)) for part in (ends.right, ends.bottom))
        size = torch.maximum(right - left, bottom - top)
        inside = (left >= 0) & (top >= 0) & (right < width) & (bottom < height) & (size < 1 << _LEVELS)
        level = (size >= 2).to(torch.int64) + (size >= 4)
        square = torch.where(inside, (level * height + top) * width + left, 0)
        one, other = _both(ends.depth, first, second)
        seen = inside & (torch.maximum(one, other) + ends.slack <= self.seen.index_select(0, square))
        hidden = inside & (torch.minimum(one, other) - ends.slack > self.hidden.index_select(0, square))
        return seen, seen | hidden


class BoxedPoints(NamedTuple):
    """Points of one view, and the pixels that they may be in for all rounding.

    Attributes:
        left: (V,) first column, int32, -1 where there is none; likewise the others.
        right: (V,) last column.
        top: (V,) first row.
        bottom: (V,) last row.
        depth: (V,).
        slack: what rounding may add to depths.
    """

    left: Tensor
    right: Tensor
    top: Tensor
    bottom: Tensor
    depth: Tensor
    slack: float

    @classmethod
    def of(cls, points: Tensor, size: tuple[int, int], rounding: tuple[float, float]) -> BoxedPoints:
        """With projected points (V, 3), (height, width), and what rounding adds to pixels and depths."""
        x, y, depth = points.T.contiguous().unbind(0)
        height, width = size
        left, right = (_pixels(x + way * rounding[0], width) for way in (-1, 1))
        top, bottom = (_pixels(y + way * rounding[0], height) for way in (-1, 1))
        return cls(left, right, top, bottom, depth, rounding[1])


def roundings(vertices: Tensor, camera: Camera, width: int) -> list[tuple[float, float]]:
    """What rounding adds, in each of some parallel views, to pixels and depths of points between vertices (V, 3)."""
    axes, origins = (part.to(vertices).abs() for part in (camera.axes, camera.origins))
    reach = (vertices.abs().amax(0) if len(vertices) else vertices.new_zeros(3)) + origins
    depths = _ROUNDINGS * torch.finfo(vertices.dtype).eps * (axes @ reach[..., None]).squeeze(-1).amax(-1)
    pixels = depths * camera.scales(width).to(vertices) + _ROUNDINGS * torch.finfo(vertices.dtype).eps * width
    return list(zip(pixels.tolist(), depths.tolist(), strict=True))


def _pixels(places: Tensor, count: int) -> Tensor:
    """Numbers of pixels, -1 and ``count`` for all beside the picture, also for NaN."""
    return places.floor().clamp(-1, count).nan_to_num(-1.0).to(torch.int32)


def _both(values: Tensor, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    return values.index_select(0, first), values.index_select(0, second)


def _pairs(values: Tensor, step: int, axis: int, largest: bool) -> Tensor:
    """Every value (H, W) with that some steps further on: the lesser or the larger; as it is where there is none."""
    count = values.shape[axis] - step
    if count <= 0:
        return values
    here, there, rest = (
        values.narrow(axis, 0, count),
        values.narrow(axis, step, count),
        values.narrow(axis, count, step),
    )
    return torch.cat([(torch.maximum if largest else torch.minimum)(here, there), rest], axis)
