"""How far places that options name are from what there is, and whether it is clear what is meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

_CLEAR = 0.8  # of the distance of the second nearest, within which the nearest one is meant
_TINY = 1e-300


def from_segments(place: Tensor, segments: Tensor) -> Tensor:
    """(n,) distances of a place (3,) from segments (n, 2, 3), which may have no length."""
    start, way = segments[:, 0], segments[:, 1] - segments[:, 0]
    share = ((place - start) * way).sum(1) / (way * way).sum(1).clamp_min(_TINY)
    distances: Tensor = (start + share.clamp(0.0, 1.0)[:, None] * way - place).norm(dim=1)
    return distances


def two_nearest(distances: Tensor) -> tuple[list[int], list[float], bool]:
    """Numbers and values of the two least distances (n,), or of the only one; whether the first is clearly less."""
    found = distances.topk(min(2, len(distances)), largest=False)
    near = found.values.tolist()
    return found.indices.tolist(), near, len(near) < 2 or near[0] < _CLEAR * near[1]
