"""Which good saddle a star is, or should become: sides of its edges, and a plane. Not differentiated."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..geometry._ops import cross, dot, norm
from ..geometry.normals import DEGENERACY, normalise
from ._cones import interior_directions
from ._patterns import four_run_patterns

LEAST_EDGES, MOST_TARGET_EDGES = 4, 16
"""Valences of the stars that have a target: with three edges nothing is a saddle, with many the patterns explode."""

_STEPS = 6


class StarShape(NamedTuple):
    """What the tests of a star are made of.

    Attributes:
        arms: (..., k, 3) unit vectors along the edges.
        sectors: (..., k, 3) unit normals of the sectors between neighbouring edges, zero without area.
        bends: (..., k) sine of the dihedral angle at each edge, positive where convex.
    """

    arms: Tensor
    sectors: Tensor
    bends: Tensor


def star_shape(arms: Tensor) -> StarShape:
    """Shape of stars with arms (..., k, 3); differentiable."""
    ahead = arms.roll(-1, -2)
    fixed = arms.detach()
    longest = dot(fixed, fixed) + dot(fixed.roll(-1, -2), fixed.roll(-1, -2))
    sectors = normalise(cross(arms, ahead), 4 * DEGENERACY * torch.finfo(arms.dtype).eps * longest)
    lengths = norm(arms)
    unit = arms / torch.where(lengths > 0, lengths, 1.0)[..., None]
    return StarShape(unit, sectors, dot(cross(sectors, sectors.roll(1, -2)), unit))


def good_patterns(valence: int) -> Tensor:
    """(P, k) sides that the edges of a good saddle may have: four runs, of valence 6 with lengths 1,2,1,2."""
    signs = four_run_patterns(valence).signs
    if valence == 6:
        signs = signs[(signs == signs.roll(3, 1)).all(1)]
    return signs.to(torch.float64)


def saddle_targets(arms: Tensor, patterns: Tensor) -> tuple[Tensor, Tensor]:
    """Sides (n, k) and unit normals (n, 3) for stars with arms (n, k, 3); ``patterns`` are :func:`good_patterns`.

    For a good saddle: the sides that its convex and concave edges demand, and the normal of a plane that has
    them. For any other star: the pattern that its edges and the plane of its mean normal violate least, and the
    plane that violates it least. Both are constants for derivatives.
    """
    shape = StarShape(*(part.detach() for part in star_shape(arms.detach())))
    table = patterns.to(shape.bends)
    mean = normalise(cross(arms.detach(), arms.detach().roll(-1, 1)).sum(1), 0.0)
    heights = dot(shape.arms, mean[:, None])
    costs = _violation(shape.bends, table)
    nearest = table[costs.argmin(1)]
    walls = torch.cat([shape.arms * nearest[..., None], shape.sectors], dim=1)
    planes, margins = interior_directions(walls)
    is_good = (costs.amin(1) == 0) & (margins > 0)
    wanted = table[(costs + _violation(heights, table)).argmin(1)]
    fitted = _fit_plane(shape, wanted, mean, heights)
    return torch.where(is_good[:, None], nearest, wanted), torch.where(is_good[:, None], planes, fitted)


def _violation(values: Tensor, table: Tensor) -> Tensor:
    """(n, P) sum of the squares of those ``values`` (n, k) whose sign is not that of the pattern."""
    above, below = values.clamp_min(0).square(), values.clamp_max(0).square()
    return below @ (table > 0).to(values).T + above @ (table < 0).to(values).T


def _fit_plane(shape: StarShape, sides: Tensor, mean: Tensor, heights: Tensor) -> Tensor:
    """Normal (n, 3) near ``mean`` for which edges are on their ``sides`` or, if that cannot be, nearly so.

    Gauss-Newton steps on the squared distances by which edges miss their side with some clearance.
    """
    flat = shape.arms - heights[..., None] * mean[:, None]
    clearance = 0.3 * heights.abs().mean(1, keepdim=True)
    tilt = torch.zeros_like(mean)
    identity = torch.eye(3, dtype=mean.dtype, device=mean.device)
    for _ in range(_STEPS):
        missed = (clearance - sides * (heights + dot(flat, tilt[:, None]))).clamp_min(0)
        rows = flat * (missed > 0).to(flat)[..., None]
        matrix = rows.transpose(1, 2) @ rows + 1e-3 * identity
        right = ((sides * missed)[..., None] * rows).sum(1)
        tilt = tilt + torch.linalg.solve_ex(matrix, right[..., None])[0].squeeze(-1)
    return normalise(mean + tilt, 0.0)
