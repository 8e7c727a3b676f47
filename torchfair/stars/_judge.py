"""Convex, saddle-shaped or neither: the exact test, for many stars with k arms at once.

Everything follows from the signs of ``n.(w_i - v)``, which side of the plane with normal ``n`` edge ``i`` is on:

- The star projects 1-1 along ``n`` if ``n`` has a positive product with all sector normals and the star runs
  around once. Let ``n`` be such from now on.
- A plane meets a sector whose edges lie on different sides. Four such sectors f < g < h < i are needed. Two
  consecutive ones, say f and g, are met in segments less than half a turn apart if and only if
  ``n.(n_f x n_g) < 0``; the four segments lie in no half-plane if that holds for all four pairs.
- For a given pattern of sides all these conditions are linear in ``n``: a cone, which is empty or not.
- Between two segments less than half a turn apart the star rises above the plane and comes back, so it has a
  convex edge there; where it lies below it has a concave edge. That excludes most patterns at once.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..geometry._ops import cross, dot
from ._cones import interior_directions
from ._groups import sector_normals, turns_once
from ._patterns import count_changes, crossed_sectors, fill_zeros, four_run_patterns, uneven
from ._planes import patterns_of_planes, planes_may_show

CONVEX, SADDLE, NEITHER = 0, 1, 2
ALL_PATTERNS = 8
"""Valence up to which all patterns of sides are tried; above it those that some plane has."""
MOST_EDGES = 24
"""Valence up to which every plane counts; stars with more edges are saddles only if they are good ones."""


class Verdicts(NamedTuple):
    """What stars are.

    Attributes:
        kinds: (n,) int8 CONVEX, SADDLE or NEITHER.
        good: (n,) bool, good saddles.
        normals: (n, 3) of a plane that shows it; zero for NEITHER.
    """

    kinds: Tensor
    good: Tensor
    normals: Tensor


def judge_stars(arms: Tensor, noise: Tensor) -> Verdicts:
    """Classes of stars with arms (n, k, 3); planes are told apart if they differ by more than ``noise`` (n,)."""
    sectors = sector_normals(arms)
    arms = arms / torch.linalg.vector_norm(arms, dim=-1, keepdim=True)
    signs = edge_signs(sectors, arms, noise)
    convex, normals = _convex(arms, sectors, noise)
    kinds = torch.where(convex, CONVEX, NEITHER).to(torch.int8)
    good = torch.zeros_like(convex)
    places = torch.nonzero(~convex & (count_changes(signs) >= 4)).squeeze(1)
    if places.numel():
        part = (arms[places], sectors[places], signs[places], noise[places])
        is_good, found = _good(*part)
        good[places] = is_good
        saddle = is_good.clone()
        others = torch.nonzero(~is_good).squeeze(1)
        if others.numel() and arms.shape[1] <= MOST_EDGES:
            saddle[others], found[others] = _best_plane(*(tensor[others] for tensor in part))
        kinds[places[saddle]] = SADDLE
        normals[places] = torch.where(saddle[:, None], found, 0.0)
    return Verdicts(kinds, good, normals)


def edge_signs(sectors: Tensor, arms: Tensor, noise: Tensor) -> Tensor:
    """(n, k) signs of the dihedral angles at unit arms: +1 convex, -1 concave, 0 flat or folded within ``noise``."""
    sines = dot(cross(sectors, sectors.roll(1, 1)), arms)
    return torch.where(sines.abs() > noise[:, None], sines.sign(), 0.0).to(torch.int8)


def _convex(arms: Tensor, sectors: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Stars that lie on one side of all planes of their sectors (or in them), and a plane beside each."""
    heights = sectors @ arms.transpose(1, 2)
    below = (heights <= noise[:, None, None]).flatten(1).all(1)
    above = (heights >= -noise[:, None, None]).flatten(1).all(1)
    # The apex of a convex cone lies above the mean of its arms; a flat star has no such side, or by rounding only.
    side = torch.where(above, 1.0, -1.0).to(arms)[:, None] * arms.sum(1)
    convex = torch.zeros_like(below)
    normals = torch.zeros_like(side)
    for trial in (sectors.sum(1), side):
        size = torch.linalg.vector_norm(trial, dim=-1, keepdim=True)
        trial = trial / size
        seen = (dot(sectors, trial[:, None]).amin(-1) > noise) & (size[:, 0] > arms.shape[1] * noise)
        fits = (below | above) & seen & turns_once(arms, trial)
        convex, normals = convex | fits, torch.where(fits[:, None], trial, normals)
    return convex, normals


def _good(arms: Tensor, sectors: Tensor, signs: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Saddles in which exactly the sectors that the plane meets are inflection faces, and that plane.

    Then no edge above the plane is concave and none below is convex, which leaves one pattern of sides. Flat
    edges, beside which no face is an inflection face, may go with either neighbour. Of valence 6 only the
    pattern 1,2,1,2 is called good.
    """
    good = torch.zeros_like(noise, dtype=torch.bool)
    normals = torch.zeros_like(arms[:, 0])
    for shift in (1, -1):
        sides = fill_zeros(signs, shift)
        fits = count_changes(sides) == 4
        if arms.shape[1] == 6:
            fits &= (sides == sides.roll(3, 1)).all(1)
        places = torch.nonzero(fits & ~good).squeeze(1)
        walls = torch.cat([arms[places] * sides[places, :, None], sectors[places]], dim=1)
        directions, margins = interior_directions(_without_idle(walls, sectors[places]))
        fits = (margins > noise[places]) & turns_once(arms[places], directions)
        good[places] = fits
        normals[places[fits]] = directions[fits]
        if not bool((signs == 0).any()):
            break
    return good, normals


def _best_plane(arms: Tensor, sectors: Tensor, signs: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Whether some plane meets each star like a saddle, and the best such plane.

    Better are planes that cut the star more evenly, see :func:`uneven`; among equals those from which all edges
    stand off by a larger angle.
    """
    stars, sides = _candidates(arms, sectors, signs)
    found = torch.zeros_like(noise, dtype=torch.bool)
    normals = torch.zeros_like(arms[:, 0])
    if not stars.numel():
        return found, normals
    crossed = crossed_sectors(sides)
    rank = uneven(crossed, arms.shape[1])
    for value in torch.unique(rank).tolist():
        chosen = torch.nonzero((rank == value) & ~found[stars]).squeeze(1)
        at = stars[chosen]
        if not at.numel():
            continue
        directions, margins = _plane_of_pattern(arms[at], sectors[at], sides[chosen], crossed[chosen], noise[at])
        fits = (margins > noise[at]) & turns_once(arms[at], directions)
        stand_off = torch.where(fits, dot(arms[at], directions[:, None]).abs().amin(1), -1.0)
        best = torch.full_like(noise, -1.0).scatter_reduce(0, at, stand_off, "amax")
        chosen = fits & (stand_off == best[at])
        found[at[chosen]] = True
        normals[at[chosen]] = directions[chosen]
    return found, normals


def _candidates(arms: Tensor, sectors: Tensor, signs: Tensor) -> tuple[Tensor, Tensor]:
    """Star numbers (p,) and patterns of sides (p, k), excluded neither by all planes nor by the signs of the edges."""
    valence = arms.shape[1]
    if valence > ALL_PATTERNS:
        stars, sides = patterns_of_planes(arms)
    else:
        table = four_run_patterns(valence).signs
        shown = planes_may_show(arms, table[::2]).repeat_interleave(2, dim=1)  # opposite patterns stand side by side
        stars, numbers = shown.nonzero().unbind(1)
        sides = table.to(arms.device, torch.int8)[numbers]
    kept = _each_run_bends(sides, signs[stars])
    return stars[kept], sides[kept]


def _each_run_bends(sides: Tensor, signs: Tensor) -> Tensor:
    """(p,) whether each run above the plane has a convex edge and each run below a concave one."""
    run = (sides != sides.roll(1, 1)).cumsum(1) % 4  # runs 0..3; the first and last piece of a run agree
    bends = sides == signs
    kept = torch.ones_like(run[:, 0], dtype=torch.bool)
    for number in range(4):
        kept &= (bends & (run == number)).any(1)
    return kept


def _plane_of_pattern(
    arms: Tensor, sectors: Tensor, sides: Tensor, crossed: Tensor, noise: Tensor
) -> tuple[Tensor, Tensor]:
    """A plane that has the edges on the given sides and meets the star in no half-plane, if there is one.

    Where the sectors at both ends of a run lie in one plane, within ``noise``, every plane meets them in opposite
    directions: they are in no half-plane, but barely, and rounding does not decide.
    """
    start, stop = _long_runs(crossed, arms.shape[1])
    first = _pick(sectors, start)
    turning = cross(_pick(sectors, stop), first)
    size = torch.linalg.vector_norm(turning, dim=-1, keepdim=True)
    turning = torch.where(size > noise[:, None, None], turning / size, first)  # which is a wall anyway
    walls = torch.cat([arms * sides[..., None], turning, sectors], dim=1)
    return interior_directions(_without_idle(walls, sectors))


def _long_runs(crossed: Tensor, valence: int) -> tuple[Tensor, Tensor]:
    """Sectors (n, r) at the start and at the end of those runs that have two edges or more.

    All patterns have equally many such runs. A run of one edge spans less than half a turn as soon as that edge
    bends the right way, which is known already.
    """
    following = crossed.roll(-1, 1)
    runs = (following - crossed) % valence
    longest = runs.argsort(dim=1, descending=True, stable=True)[:, : int((runs[0] > 1).sum())]
    return crossed.gather(1, longest), following.gather(1, longest)


def _pick(sectors: Tensor, index: Tensor) -> Tensor:
    """Sectors (n, r, 3) with the given numbers (n, r)."""
    return sectors.gather(1, index[..., None].expand(-1, -1, 3))


def _without_idle(walls: Tensor, sectors: Tensor) -> Tensor:
    """Drops the walls ``sectors``, which come last, if the others imply them for all stars at hand.

    The other walls keep the normal among the sector normals; if these are pairwise less than a right angle
    apart, it has a positive product with all of them.
    """
    steepest = (sectors @ sectors.transpose(1, 2)).flatten(1).amin() if sectors.numel() else sectors.new_ones(())
    return walls[:, : -sectors.shape[1]] if bool(steepest > 0) else walls
