"""Sparse direct solver of the optional package rslab: L D L^T with the symbolic analysis kept."""

from __future__ import annotations

import importlib.util

import numpy as np
import scipy.sparse as sp

from ...errors import SingularSystemError
from ..system import Structure
from .direct import SparseDirect, Substitution


class RslabDirect(SparseDirect):
    """Supernodal ``L D L^T`` (``pip install torchfair[direct]``); several times faster than SuperLU.

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

        pattern = structure.normal_pattern
        self._size = pattern.num_unknowns
        ones = np.ones(pattern.rows.size)
        ones[pattern.offsets[:-1]] = self._size
        lower = sp.csc_matrix((ones, pattern.rows, pattern.offsets), (self._size, self._size))
        # Nested dissection takes part in the race of orderings from small sizes on: a fifth less work per factor.
        self._symbolic = rslab.analyze(lower, path="ldlt", race_nd_min_n=1000, race_nd_min_work=1_000_000)

    def factorise(self, values: np.ndarray) -> Substitution:
        """See :class:`SparseDirect`."""
        try:
            factor = self._symbolic.factor(values)
        except (RuntimeError, ValueError) as error:
            raise SingularSystemError(f"rslab: {error}") from None
        if factor.inertia[0] != self._size:
            raise SingularSystemError(f"the normal matrix is not positive definite (inertia {factor.inertia})")
        solve: Substitution = factor.solve
        return solve
