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

_STEPS = 8


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


def saddle_sides(arms: Tensor, patterns: Tensor) -> Tensor:
    """Sides (n, k) that the edges of stars with arms (n, k, 3) have or should have.

    The ``patterns`` (P, k) to choose from are those of :func:`good_patterns`.

    For a good saddle those that its convex and concave edges demand. For any other star the pattern that its
    edges, and the plane of its mean normal, violate least.
    """
    shape = _fixed_shape(arms)
    table = patterns.to(shape.bends)
    costs = _violation(shape.bends, table)
    nearest = table[costs.argmin(1)]
    _, margins = interior_directions(_walls(shape, nearest))
    is_good = (costs.amin(1) == 0) & (margins > 0)
    heights = dot(shape.arms, _mean_normal(arms)[:, None])
    wanted = table[(costs + _violation(heights, table)).argmin(1)]
    return torch.where(is_good[:, None], nearest, wanted)


def saddle_planes(arms: Tensor, sides: Tensor, margin: float = 0.0) -> Tensor:
    """Unit normals (n, 3) of the planes for which edges miss their ``sides`` (n, k), by ``margin``, least.

    Where some plane misses none, it is one of those. Being the minimiser, the normal may be held constant when
    the sum of the squared defects is differentiated.
    """
    shape = _fixed_shape(arms)
    inside, margins = interior_directions(_walls(shape, sides))
    mean = _mean_normal(arms)
    clearance = 0.3 * dot(shape.arms, mean[:, None]).abs().mean(1, keepdim=True)
    near = _fit_plane(shape, sides, mean, clearance)
    start = torch.where((margins > 0)[:, None], inside, near)
    return _fit_plane(shape, sides, start, torch.full_like(clearance, margin))


def _fixed_shape(arms: Tensor) -> StarShape:
    return StarShape(*(part.detach() for part in star_shape(arms.detach())))


def _mean_normal(arms: Tensor) -> Tensor:
    return normalise(cross(arms.detach(), arms.detach().roll(-1, 1)).sum(1), 0.0)


def _walls(shape: StarShape, sides: Tensor) -> Tensor:
    return torch.cat([shape.arms * sides[..., None], shape.sectors], dim=1)


def _violation(values: Tensor, table: Tensor) -> Tensor:
    """(n, P) sum of the squares of those ``values`` (n, k) whose sign is not that of the pattern."""
    above, below = values.clamp_min(0).square(), values.clamp_max(0).square()
    return below @ (table > 0).to(values).T + above @ (table < 0).to(values).T


def _fit_plane(shape: StarShape, sides: Tensor, start: Tensor, clearance: Tensor) -> Tensor:
    """Normal (n, 3) near ``start`` at which the squares of what edges lack of ``clearance`` (n, 1) are least in sum.

    The sum is convex and piecewise quadratic in the normal but for its length: Gauss-Newton steps end after a few.
    """
    ridge = max(1e-9, 1e3 * torch.finfo(start.dtype).eps)  # keeps stars that leave the normal open solvable
    identity = ridge * torch.eye(3, dtype=start.dtype, device=start.device)
    normal = start
    for _ in range(_STEPS):
        heights = dot(shape.arms, normal[:, None])
        missed = (clearance - sides * heights).clamp_min(0)
        flat = shape.arms - heights[..., None] * normal[:, None]
        rows = flat * (missed > 0).to(flat)[..., None]
        matrix = rows.transpose(1, 2) @ rows + normal[:, :, None] * normal[:, None, :] + identity
        right = ((sides * missed)[..., None] * rows).sum(1)
        normal = normalise(normal + torch.linalg.solve_ex(matrix, right[..., None])[0].squeeze(-1), 0.0)
    return normal
