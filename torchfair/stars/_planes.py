"""Patterns of sides that planes through the centre of a star have: for stars with many edges."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross, dot
from ._patterns import count_changes

_TIE = 1e-9
_RATIOS = (1.0, 1e-3, 1e3)


def patterns_of_planes(arms: Tensor) -> tuple[Tensor, Tensor]:
    """All patterns of four runs that some plane through the centre has.

    The sides on which edges lie change only where the plane contains an edge, so each pattern is that of a cell
    between the great circles ``n.a_i = 0``. Every cell has a corner, where two of the circles meet; the four
    cells around each corner are tried (several directions, for corners where more than two circles meet).

    Args:
        arms: (n, k, 3) unit vectors, k below 60.

    Returns:
        Star numbers (p,) and sides (p, k) int8, each pattern once, and with it the opposite one.
    """
    size = arms.shape[1]
    first, second = torch.triu_indices(size, size, 1, device=arms.device)
    bits = 2 ** torch.arange(size, device=arms.device)
    found = [torch.zeros(0, 2, dtype=torch.int64, device=arms.device)]
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        corner = cross(arms[:, i], arms[:, j])
        dual = cross(arms[:, j], corner), cross(corner, arms[:, i])  # one is orthogonal to arm j, one to arm i
        heights = dot(arms, corner[:, None])
        heights = torch.where(heights.abs() > _TIE, heights, 0.0).sign()
        slopes = [dot(arms, direction[:, None]) for direction in dual]
        for ratio in _RATIOS:
            for flip in (1.0, -1.0):
                tilt = slopes[0] + flip * ratio * slopes[1]
                sides = torch.where(heights == 0, tilt.sign(), heights)
                opposite = torch.where(heights == 0, -tilt.sign(), heights)
                found += [_codes(s, bits) for s in (sides, opposite)]
    rows = torch.unique(torch.cat(found), dim=0)
    stars, codes = rows.unbind(1)
    sides = torch.where((codes[:, None] & bits) != 0, 1, -1).to(torch.int8)
    return stars.repeat(2), torch.cat([sides, -sides])


def _codes(sides: Tensor, bits: Tensor) -> Tensor:
    """Rows (star, code) of those patterns that have four runs and no zero."""
    chosen = torch.nonzero((count_changes(sides) == 4) & (sides != 0).all(1)).squeeze(1)
    return torch.stack([chosen, ((sides[chosen] > 0) * bits).sum(1)], dim=1)
