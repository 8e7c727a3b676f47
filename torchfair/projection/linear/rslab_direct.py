"""Sparse direct solver of the optional package rslab: L D L^T with the symbolic analysis kept."""

from __future__ import annotations

import importlib.util
import os
from typing import Any

import numpy as np
import scipy.sparse as sp

from ...errors import SingularSystemError
from ..system import Structure
from .direct import SparseDirect, Substitution

_ROUGHEST = 1e-12  # relative remainder of every step, so that results do not depend on how sums are rounded
_REFINEMENTS = 8
_SMALLEST_RACE = 20_000  # unknowns
_LEAST_PROGRESS = 0.1  # of a refinement that is worth another one


class RslabDirect(SparseDirect):
    """Supernodal ``L D L^T`` (``pip install torchfair[direct]``); several times faster than SuperLU.

    The factor is computed in single precision, in half the time, and its solution refined with the matrix in
    double precision until the remainder is below 1e-12 of the right-hand side, or the accuracy asked for. Where
    that fails, the factor is computed again in double precision, and so it stays until the next :meth:`prepare`.

    Factors whose inertia is not positive are refused, so that an indefinite matrix raises the damping.
    """

    name = "rslab"

    @staticmethod
    def available() -> bool:
        """Whether the package is installed."""
        return importlib.util.find_spec("rslab") is not None

    def prepare(self, structure: Structure) -> None:
        """Orders and analyses the pattern, once."""
        import rslab

        self._pattern = structure.normal_pattern
        self._size = self._pattern.num_unknowns
        self.single = True
        ones = np.ones(self._pattern.rows.size)
        ones[self._pattern.offsets[:-1]] = self._size
        # Nested dissection goes down to small parts, which saves a fifth of the work per factor. It takes part in the
        # race of orderings where it gains more in ten factors than the race costs. Columns are merged generously: a
        # tenth less time for a few zeros more.
        self._symbolic = rslab.analyze(
            self._lower(ones),
            path="ldlt",
            race_nd_min_n=_SMALLEST_RACE,
            race_nd_min_work=1_000_000,
            nd_leaf_size=100,
            nemin=32,
            threads=("auto", os.cpu_count() or 1),
        )

    def _lower(self, values: np.ndarray) -> sp.csc_matrix:
        return sp.csc_matrix((values, self._pattern.rows, self._pattern.offsets), (self._size, self._size))

    def factorise(self, values: np.ndarray, accuracy: float) -> Substitution:
        """See :class:`SparseDirect`."""
        if not self.single:
            return self._double(values)
        try:
            factor = self._factor(values, factor_dtype="float32")
        except SingularSystemError:  # perhaps only to single precision
            return self._double(values)

        def substitute(right: np.ndarray) -> np.ndarray:
            solution = self._refine(factor, values, right, min(accuracy, _ROUGHEST))
            return self._double(values)(right) if solution is None else solution

        return substitute

    def _double(self, values: np.ndarray) -> Substitution:
        substitute: Substitution = self._factor(values).solve
        self.single = False
        return substitute

    def _factor(self, values: np.ndarray, **settings: str) -> Any:
        try:
            factor = self._symbolic.factor(values, **settings)
        except (RuntimeError, ValueError) as error:
            raise SingularSystemError(f"rslab: {error}") from None
        if factor.inertia[0] != self._size:
            raise SingularSystemError(f"the normal matrix is not positive definite (inertia {factor.inertia})")
        return factor

    def _refine(self, factor: Any, values: np.ndarray, right: np.ndarray, accuracy: float) -> np.ndarray | None:
        """Solution by a factor in single precision; None if it stays inaccurate."""
        lower, diagonal = self._lower(values), values[self._pattern.offsets[:-1]]
        solution: np.ndarray = np.zeros_like(right)
        remainder, target = right, accuracy * np.linalg.norm(right)
        for _ in range(1 + _REFINEMENTS):
            before = np.linalg.norm(remainder)
            solution = solution + factor.solve(remainder)
            remainder = right - (lower @ solution + lower.T @ solution - diagonal * solution)
            size = np.linalg.norm(remainder)
            if size <= target:
                return solution
            if not size <= _LEAST_PROGRESS * before:
                return None
        return None
