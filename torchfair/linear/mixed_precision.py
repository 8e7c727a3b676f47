"""Direct solvers that factor in single precision and refine with the matrix in double precision."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from ..errors import SingularSystemError
from .direct import TIGHTEST, SparseDirect, Substitution
from .lower_triangle import LowerTriangle

_REFINEMENTS = 8
_LEAST_PROGRESS = 0.1  # of a refinement that is worth another one

Solve = Callable[[np.ndarray], np.ndarray]


class MixedPrecision(SparseDirect):
    """Factors in single precision, whose solutions are refined with the matrix in double precision.

    Refinement goes on until the remainder is below 1e-12 of the right-hand side, or the accuracy asked for. Where that
    fails, the factor is computed again in double precision, and so it stays until the pattern changes.

    Args:
        mixed: False for factors in double precision from the first on. These take twice as long, and half as long to
            solve with: better for many right-hand sides, and for matrices that are known to be nearly singular.

    Attributes:
        single: whether factors are still in single precision.
    """

    single: bool
    mixed = True

    def __init__(self, mixed: bool = True) -> None:
        self.mixed = mixed

    def analyse(self, lower: LowerTriangle) -> None:
        """Orders and analyses the pattern."""
        self.single = self.mixed
        self.places = lower
        self.order(lower)

    @abstractmethod
    def order(self, lower: LowerTriangle) -> None:
        """Symbolic work, once for each pattern."""

    @abstractmethod
    def numeric(self, values: np.ndarray, single: bool) -> Solve:
        """A factor in either precision, as the map from right-hand sides (N,) or (N, k) to solutions in double.

        Raises:
            SingularSystemError: the matrix is singular or indefinite.
        """

    def factor(self, values: np.ndarray) -> Substitution:
        """Factors a matrix of the pattern; see ``SparseDirect``."""
        if not self.single:
            return self._double(values)
        try:
            rough = self.numeric(values, single=True)
        except SingularSystemError:  # perhaps only to single precision
            return self._double(values)
        exact: list[Substitution] = []

        def substitute(right: np.ndarray, accuracy: float) -> np.ndarray:
            solution = None if exact else self._refine(rough, values, right, min(accuracy, TIGHTEST))
            if solution is None:
                if not exact:
                    exact.append(self._double(values))
                return exact[0](right, accuracy)
            return solution

        return substitute

    def _double(self, values: np.ndarray) -> Substitution:
        solve = self.numeric(values, single=False)
        self.single = False
        return lambda right, accuracy: solve(right)

    def _refine(self, solve: Solve, values: np.ndarray, right: np.ndarray, accuracy: float) -> np.ndarray | None:
        """Solution by a factor in single precision; None if it stays inaccurate."""
        lower, diagonal = self.places.matrix(values), values[self.places.diagonal]
        diagonal = diagonal if right.ndim == 1 else diagonal[:, None]
        solution: np.ndarray = np.zeros_like(right)
        remainder, target = right, accuracy * np.linalg.norm(right, axis=0)
        for _ in range(1 + _REFINEMENTS):
            before = np.linalg.norm(remainder, axis=0)
            solution = solution + solve(remainder)
            remainder = right - (lower @ solution + lower.T @ solution - diagonal * solution)
            size = np.linalg.norm(remainder, axis=0)
            unfinished = ~(size <= target)
            if not unfinished.any():
                return solution
            if not (size <= _LEAST_PROGRESS * before)[unfinished].all():
                return None
        return None
