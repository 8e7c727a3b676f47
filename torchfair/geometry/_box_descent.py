"""Which items of a box tree may be nearest to points: a descent in torch, of fixed size for every point."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from ._closest_boxes import BoxTree

_TOP = 6  # depth at which searches start; all boxes of that depth are looked at
_STEP = 2  # levels taken at once on the way down
_KEPT = 8  # boxes that are followed further


class BoxDescent:
    """Follows the few boxes nearest to each point from level to level, whatever is found: no step waits for a result.

    Args:
        tree: boxes of T items in d coordinates.
        device: where points will be.
    """

    def __init__(self, tree: BoxTree, device: torch.device) -> None:
        self._depths = [*range(min(_TOP, tree.depth), tree.depth, _STEP), tree.depth]
        self._levels = [torch.from_numpy(tree.level(depth)).to(device) for depth in self._depths]
        self._items = torch.from_numpy(tree.items).to(device)

    def to(self, device: torch.device | str) -> BoxDescent:
        """The same for points on another device."""
        moved = copy.copy(self)
        moved._levels, moved._items = [level.to(device) for level in self._levels], self._items.to(device)
        return moved

    def candidates(self, points: Tensor) -> Tensor:
        """Items (N, k) whose boxes are nearest to ``points`` (d, N), and others where there are fewer than k.

        The item nearest to a point is among them unless more than k boxes, at some level, lie nearer than it.
        """
        nodes, above = None, 0
        for depth, boxes in zip(self._depths, self._levels, strict=True):
            children = torch.arange(1 << (depth - above), device=points.device)
            if nodes is None:  # all boxes at the top
                nodes, sides = children.expand(points.shape[1], -1), [*boxes[:, None]]
            else:
                nodes = ((nodes << (depth - above))[..., None] + children).flatten(1)
                sides = [side.index_select(0, nodes.reshape(-1)).view(nodes.shape) for side in boxes]
            if nodes.shape[1] > _KEPT:
                nearest = _squared_gaps(sides, points).topk(_KEPT, dim=1, largest=False, sorted=False)
                nodes = nodes.gather(1, nearest.indices)
            above = depth
        return self._items[nodes]


def _squared_gaps(sides: list[Tensor], points: Tensor) -> Tensor:
    """(N, k) squared distances of points (d, N) from their boxes, zero inside: d low and d high sides (N or 1, k)."""
    half = len(points)
    total = torch.zeros((), dtype=points.dtype, device=points.device)
    for place, least, most in zip(points[..., None], sides[:half], sides[half:], strict=True):
        gap = torch.maximum(least - place, place - most).clamp_min_(0.0)
        total = torch.addcmul(total, gap, gap)
    return total
