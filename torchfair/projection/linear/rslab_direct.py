"""Sparse direct solver of the optional package rslab: L D L^T with the symbolic analysis kept."""

from __future__ import annotations

import importlib.util

import torch

from ...errors import SingularSystemError
from ..system import LinearSystem, Structure
from .base import Step

_SMALL = 2_000_000  # entries of the lower triangle below which one thread factors as fast as several


class RslabDirect:
    """Supernodal ``L D L^T`` (``pip install torchfair[direct]``); several times faster than SuperLU.

    Factors whose inertia is not positive are refused, so that an indefinite matrix raises the damping.
    """

    name = "rslab"
    inexact = False

    @staticmethod
    def available() -> bool:
        """Whether the package is installed."""
        return importlib.util.find_spec("rslab") is not None

    def prepare(self, structure: Structure) -> None:
        """Orders and analyses the pattern, once."""
        import numpy as np
        import rslab
        import scipy.sparse as sp

        self._pattern = structure.normal_pattern
        size = self._pattern.num_unknowns
        ones = np.ones(self._pattern.rows.size)
        ones[self._pattern.offsets[:-1]] = size
        lower = sp.csc_matrix((ones, self._pattern.rows, self._pattern.offsets), (size, size))
        self._symbolic = rslab.analyze(lower + sp.tril(lower, -1).T, path="ldlt")

    def solve(self, system: LinearSystem, damping: torch.Tensor, accuracy: float) -> Step:
        """One damped step; see the protocol."""
        import numpy as np

        values = system.normal_values.cpu().numpy().astype(np.float64, copy=True)
        values[self._pattern.offsets[:-1]] += damping.cpu().numpy()
        if not np.isfinite(values).all():
            raise SingularSystemError("the normal matrix is not finite")
        try:
            factor = self._symbolic.factor(values, threads=1 if values.size < _SMALL else None)
        except (RuntimeError, ValueError) as error:
            raise SingularSystemError(f"rslab: {error}") from None
        if factor.inertia[0] != self._pattern.num_unknowns:
            raise SingularSystemError(f"the normal matrix is not positive definite (inertia {factor.inertia})")
        solution = factor.solve(-system.gradient.cpu().numpy().astype(np.float64))
        if not np.isfinite(solution).all():
            raise SingularSystemError("the normal matrix is singular to working precision")
        change = torch.from_numpy(solution).to(system.gradient)
        return Step(change, torch.zeros_like(change))
