"""Which items of a box tree may be nearest to points: a descent in torch, of fixed size for every point."""

from __future__ import annotations

import torch
from torch import Tensor

from ._closest_boxes import BoxTree

_TOP = 5  # depth at which searches start; all boxes of that depth are looked at
_STEP = 2  # levels taken at once on the way down
_KEPT = 6  # boxes that are followed further


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

    def candidates(self, points: Tensor) -> Tensor:
        """Items (N, k) whose boxes are nearest to ``points`` (d, N), and others where there are fewer than k.

        The item nearest to a point is among them unless more than k boxes, at some level, lie nearer than it.
        """
        above = self._depths[0]
        nodes = torch.arange(1 << above, device=points.device).expand(points.shape[1], -1)
        for depth, boxes in zip(self._depths, self._levels, strict=True):
            children = torch.arange(1 << (depth - above), device=points.device)
            nodes = ((nodes << (depth - above))[..., None] + children).flatten(1)
            if nodes.shape[1] > _KEPT:
                nearest = _squared_gaps(boxes, nodes, points).topk(_KEPT, dim=1, largest=False, sorted=False)
                nodes = nodes.gather(1, nearest.indices)
            above = depth
        return self._items[nodes]


def _squared_gaps(boxes: Tensor, nodes: Tensor, points: Tensor) -> Tensor:
    """(N, k) squared distances of points (d, N) from the boxes (2 d, M) with numbers ``nodes`` (N, k), zero inside."""
    low, high = boxes.chunk(2)
    flat = nodes.reshape(-1)
    total = torch.zeros(nodes.shape, dtype=points.dtype, device=points.device)
    for place, least, most in zip(points[..., None], low, high, strict=True):
        below, above = (side.index_select(0, flat).view(nodes.shape) for side in (least, most))
        gap = torch.maximum(below - place, place - above).clamp_min_(0.0)
        total.addcmul_(gap, gap)
    return total
