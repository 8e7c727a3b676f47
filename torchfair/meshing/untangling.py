"""Triangles that a map turns over are turned back by moving values around them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.optimize import minimize

from ..fields.frames import Bools, Floats, Ints
from .seamless_map import WANTED, MapProblem, SeamlessMap, badness

_RINGS = (3, 6, 12)  # around triangles turned over, tried one after the other
_ROUNDS = 40
_IDLE = 6  # rounds without progress
_STEPS = 60  # of a round
_ENOUGH = 0.02  # of the area wanted
_NEARLY = 8  # triangles turned over and branches: only so few are worth a larger patch
_HOPELESS = 40  # of them, or this share of all triangles, have never been turned back
_HOPELESS_SHARE = 0.01
_ALIGNMENT = 0.05  # weight of the least squares of the map beside the shape of triangles


def is_hopeless(found: SeamlessMap) -> bool:
    """Whether so much is turned over that untangling is not worth its time: whole numbers or creases are in the way."""
    return badness(found)[0] > max(_HOPELESS, _HOPELESS_SHARE * len(found.areas))


def untangled(problem: MapProblem, found: SeamlessMap) -> SeamlessMap:
    r"""The map with triangles turned back where values that are not whole can do it.

    Around triangles that are turned over it minimises the energy of Garanzha, Kaporin, Kudryavtseva, Protais, Ray,
    Sokolov (*Foldover-free maps in 50 lines of code*, 2021), beside the least squares of the map::

        sum_f A_f (|J|^2 + D^2 + 1) / chi(D),    chi(D) = (D + sqrt(eps^2 + D^2)) / 2,    D = det J,

    with ``J`` relative to the gradients wanted. ``eps`` falls as the least D rises: the energy becomes a
    barrier. Larger patches are tried only where little is left to turn back.

    Args:
        problem: whose free values may move.
        found: a map of it.
    """
    for rings in _RINGS:
        if found.is_sound or (rings > _RINGS[0] and badness(found)[0] > _NEARLY):
            break
        better = _Patch.around(problem, found, rings).solve()
        if badness(better) < badness(found):
            found = better
    return found


@dataclass(frozen=True, eq=False)
class _Patch:
    """Triangles whose Jacobians are affine in the values that may move: ``slope @ x + start``, four rows of each."""

    problem: MapProblem
    values: np.ndarray
    slope: sp.csr_matrix
    start: Floats
    areas: Floats
    weights: Floats
    moves: sp.csr_matrix

    @cached_property
    def _transposed(self) -> sp.csr_matrix:
        return self.slope.T.tocsr()

    @classmethod
    def around(cls, problem: MapProblem, found: SeamlessMap, rings: int) -> _Patch:
        """The triangles within some rings of those turned over; values on its rim stay."""
        frames, triangles = found.frames, found.frames.triangles
        inside: Bools = np.asarray(np.isin(triangles, found.branches).any(1))
        inside[found.flips] = True
        inside = frames.grown(inside, rings)
        rim = np.zeros(len(frames.points), bool)
        rim[triangles[~inside]] = True
        faces = np.flatnonzero(inside)
        jacobians = problem.jacobians(faces)
        copies = np.unique(problem.seams.copies[faces])
        unknowns = _movable(problem, copies, ~rim[problem.seams.vertex])
        moves = problem.split.free[:, unknowns].tocsr()
        parts = np.stack([found.values.real, found.values.imag], axis=1).ravel()
        areas = frames.areas[faces] / frames.areas[faces].mean()
        weights = problem.weights(faces)
        return cls(problem, parts, (jacobians @ moves).tocsr(), jacobians @ parts, areas, weights, moves)

    def solve(self) -> SeamlessMap:
        """What the values are moved to; the start is of no consequence, as the energy is smooth at first."""
        zero = np.zeros(self.slope.shape[1])
        return self._at(self._minimised(zero) if len(zero) else zero)

    def _at(self, x: Floats) -> SeamlessMap:
        return self.problem.map_of(self.values + self.moves @ x)

    def _minimised(self, x: Floats) -> Floats:
        least = self._least(x)
        epsilon, energy, best, idle = 1.0, np.inf, least, 0
        for _ in range(_ROUNDS):
            answer = minimize(self._energy, x, (epsilon,), method="L-BFGS-B", jac=True, options={"maxiter": _STEPS})
            x, before, energy = answer.x, energy, float(answer.fun)
            least = self._least(x)
            if least > _ENOUGH and energy > 0.99 * before:
                break
            idle = 0 if least > best else idle + 1
            best = max(best, least)
            if idle >= _IDLE:
                break
            progress = max(1 - energy / before, 0.1) if np.isfinite(before) else 0.1
            bound = (1 - progress) * (least + np.hypot(epsilon, least)) / 2
            epsilon = 2 * np.sqrt(bound * (bound - least)) if least < bound else 1e-6
        return x

    def _least(self, x: Floats) -> float:
        a, b, c, d = (self.slope @ x + self.start).reshape(4, -1)
        return float((a * d - b * c).min())

    def _energy(self, x: Floats, epsilon: float) -> tuple[float, Floats]:
        a, b, c, d = jacobian = (self.slope @ x + self.start).reshape(4, -1)
        det = a * d - b * c
        root = np.hypot(epsilon, det)
        chi = np.where(det > 0, (det + root) / 2, epsilon**2 / (2 * (root + np.abs(det))))  # without cancellation
        size = (jacobian**2).sum(0) + det**2 + 1
        cofactors = np.stack([d, -c, -b, a])
        slope = 2 * jacobian / chi + cofactors * (2 * det / chi - size / (chi * root))
        off = jacobian - WANTED[:, None]
        energy = self.areas @ (size / chi + _ALIGNMENT * (self.weights * off**2).sum(0))
        slope = self.areas * (slope + 2 * _ALIGNMENT * self.weights * off)
        return float(energy), np.asarray(self._transposed @ slope.ravel())


def _movable(problem: MapProblem, copies: Ints, allowed: Bools) -> Ints:
    """Free unknowns of the copies of vertices that may move."""
    chosen = copies[allowed[copies]]
    rows = problem.split.free[np.concatenate([2 * chosen, 2 * chosen + 1])]
    return np.unique(rows.indices).astype(np.int64)
