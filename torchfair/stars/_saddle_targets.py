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

_STEPS, _POLISHING = 8, 6
_DAMPINGS = (0.0, 1.0, 5.0, 30.0, 200.0)  # times what the sphere adds to the second derivatives


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
    """Unit normals (n, 3) of the planes for which stars miss being good saddles, by ``margin``, least.

    What counts is that edges are on their ``sides`` (n, k) and that sectors project one-to-one. Where some plane misses
    nothing, it is one of those. Being the minimiser, the normal may be held constant when the sum of the squared
    defects is differentiated. (Of stars noisy beyond recognition, about one in two thousand has a normal that is none.)
    """
    shape = _fixed_shape(arms)
    walls = _walls(shape, sides)
    inside, margins = interior_directions(walls)
    mean = _mean_normal(arms)
    clearance = 0.3 * dot(shape.arms, mean[:, None]).abs().mean(1, keepdim=True)
    near = _fit_plane(walls, mean, clearance)
    start = torch.where((margins > 0)[:, None], inside, near)
    least = torch.full_like(clearance, margin)
    return _polished(walls, _fit_plane(walls, start, least), least)


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


class _Fit(NamedTuple):
    """Half the sum of squares of what ``walls . normal`` lacks of clearance: value (n,), and derivatives on the sphere.

    Attributes:
        value: (n,)
        descent: (n, 3) minus the gradient, orthogonal to the normal.
        squares: (n, 3, 3) Gauss-Newton matrix, with 1 along the normal.
        bend: (n,) what the sphere adds to it across the normal.
    """

    value: Tensor
    descent: Tensor
    squares: Tensor
    bend: Tensor

    @classmethod
    def at(cls, normal: Tensor, walls: Tensor, clearance: Tensor) -> _Fit:
        heights = dot(walls, normal[:, None])
        missed = (clearance - heights).clamp_min(0)
        flat = walls - heights[..., None] * normal[:, None]
        rows = flat * (missed > 0).to(flat)[..., None]
        ridge = max(1e-9, 1e3 * torch.finfo(normal.dtype).eps)  # keeps stars that leave the normal open solvable
        along = normal[:, :, None] * normal[:, None, :]
        squares = rows.transpose(1, 2) @ rows + along + ridge * torch.eye(3, dtype=normal.dtype, device=normal.device)
        descent = (missed[..., None] * rows).sum(1)
        return cls(0.5 * missed.square().sum(1), descent, squares, (missed * heights).sum(1))


def _fit_plane(walls: Tensor, start: Tensor, clearance: Tensor) -> Tensor:
    """Normal (n, 3) near ``start`` at which the squares of what ``walls`` (n, m, 3) lack of ``clearance`` are least.

    The sum is convex and piecewise quadratic in the normal but for its length: Gauss-Newton steps end after a few where
    little is lacking.
    """
    normal = start
    for _ in range(_STEPS):
        fit = _Fit.at(normal, walls, clearance)
        normal = _stepped(normal, fit.squares, fit.descent)
    return normal


def _polished(walls: Tensor, normal: Tensor, clearance: Tensor) -> Tensor:
    """The same to rounding where much is lacking, by Newton steps with the damping that helps most, if any does.

    Where much is lacking the sum is not convex on the sphere, and steps without damping may lead over its kinks.
    """
    fit = _Fit.at(normal, walls, clearance)
    eye, rounding = torch.eye(3, dtype=normal.dtype, device=normal.device), 8 * torch.finfo(normal.dtype).eps
    for _ in range(_POLISHING):
        across = eye - normal[:, :, None] * normal[:, None, :]
        best, value, slope = normal, fit.value, norm(fit.descent)
        for damping in _DAMPINGS:
            bend = fit.bend + damping * fit.bend.abs()
            other = _stepped(normal, fit.squares + bend[:, None, None] * across, fit.descent)
            there = _Fit.at(other, walls, clearance)
            slope_there = norm(there.descent)
            is_lower, is_equal = there.value < value - rounding * value, there.value <= value + rounding * value
            helps = is_lower | (is_equal & (slope_there < slope))
            best = torch.where(helps[:, None], other, best)
            value, slope = torch.where(helps, there.value, value), torch.where(helps, slope_there, slope)
        normal, fit = best, _Fit.at(best, walls, clearance)
    return normal


def _stepped(normal: Tensor, matrix: Tensor, right: Tensor) -> Tensor:
    return normalise(normal + torch.linalg.solve_ex(matrix, right[..., None])[0].squeeze(-1), 0.0)
