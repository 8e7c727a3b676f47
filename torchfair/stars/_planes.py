"""Patterns of sides that planes through the centre of a star have."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross, dot
from ._patterns import count_changes

_TIE = 1e-9
_DOUBT = 1e-8  # heights of unit arms over a plane that may be of either sign
_RATIOS = (1.0, 1e-3, 1e3)


def planes_may_show(arms: Tensor, patterns: Tensor) -> Tensor:
    """Which patterns of sides planes through the centre of each star may have, up to rounding.

    Of a star with k edges only ``k (k - 1) + 2`` patterns are those of planes, and all but a few of them have two runs.
    A plane that has a pattern can be turned until it contains two edges while all others stay where they are, so it
    is enough to look at planes through two edges: those are on either side of them, and so are edges within rounding.

    Args:
        arms: (n, k, 3) unit vectors, k at most 15.
        patterns: (P, k) sides, +1 or -1.

    Returns:
        (n, P) bool, true for every pattern that a plane has.
    """
    size = arms.shape[1]
    first, second = torch.triu_indices(size, size, 1, device=arms.device)
    x, y, z = (axis.contiguous() for axis in arms.permute(2, 1, 0))  # (k, n) each
    (ax, ay, az), (bx, by, bz) = ([axis.index_select(0, side) for axis in (x, y, z)] for side in (first, second))
    normals = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]  # (pairs, n) each
    least = _DOUBT * (normals[0] ** 2 + normals[1] ** 2 + normals[2] ** 2).sqrt()  # 0, as all heights, if parallel
    above, below = (torch.zeros_like(least, dtype=torch.int16) for _ in range(2))
    for arm in range(size):
        height = normals[0] * x[arm] + normals[1] * y[arm] + normals[2] * z[arm]
        above += (height > least).to(torch.int16) << arm
        below += (height < -least).to(torch.int16) << arm
    return torch.stack([_agrees(above, below, side) for side in _bits(patterns)], dim=1)


def _agrees(above: Tensor, below: Tensor, pattern: int) -> Tensor:
    """(n,) whether a pattern or its opposite has edges ``above`` and ``below`` one of m planes (m, n), bits, there."""
    rest = ~pattern
    same = ((above & rest) | (below & pattern)) == 0
    opposite = ((above & pattern) | (below & rest)) == 0
    return (same | opposite).any(0)


def _bits(patterns: Tensor) -> list[int]:
    """Sides (P, k) as numbers with a bit for each edge above the plane."""
    numbers: list[int] = ((patterns > 0).to(torch.int64) << torch.arange(patterns.shape[1])).sum(1).tolist()
    return numbers


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
