"""Lengths and weights of a map that are adapted to the field, so that its lines can follow the directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..fields.frames import Bools, Floats
from .seamless_map import MapProblem

_FOLLOWED = 0.8  # of the logarithm of a stretch
_MOST_STRETCH = 4.0
_ROUNDS = 3
_THIN = 0.02  # of the area wanted
_RINGS = 3  # around triangles that are turned over
_LOOSER = 5.0  # times, until the map is one of right lengths as much as of right directions


def stretched(problem: MapProblem, rounds: int = _ROUNDS) -> MapProblem:
    """The problem with lengths nearer to those that the field allows.

    Lines that follow a field diverge and converge. In least squares for lengths that are the same everywhere they
    leave the directions where that is the cheaper error. So the densities that come out are asked for, up to four
    times those of the problem or a fourth of them, and errors are measured against them.

    Args:
        problem: with the densities wanted.
        rounds: how often densities are read off and asked for.
    """
    wanted = problem.density
    for _ in range(rounds):
        problem = replace(problem, density=_followed(problem, wanted))
    return problem


def loosened(problem: MapProblem, wanted: Floats, rounds: int = _ROUNDS) -> MapProblem:
    """The problem with directions that weigh less around triangles that the real optimum turns over.

    Args:
        problem: of a map.
        wanted: (F, 2) densities that lengths are to stay near; see :func:`stretched`.
        rounds: how often weights fall around triangles that are turned over still.
    """
    frames = problem.frames
    for _ in range(rounds):
        a, b, c, d = problem.real_jacobians
        over: Bools = a * d - b * c < _THIN
        if not over.any():
            break
        near = frames.grown(over, _RINGS)
        weights = np.where(near, np.maximum(problem.anisotropy / _LOOSER, 1.0), problem.anisotropy)
        problem = replace(problem, anisotropy=weights, density=_followed(problem, wanted))
    return problem


def _followed(problem: MapProblem, wanted: Floats) -> Floats:
    found = problem.density * problem.real_jacobians[[0, 3]].T
    stretch = np.clip(found / wanted, 1 / _MOST_STRETCH, _MOST_STRETCH)
    return np.asarray(wanted * stretch**_FOLLOWED)
