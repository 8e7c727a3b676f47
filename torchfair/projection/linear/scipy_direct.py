"""Sparse direct solver that is always there: SuperLU in symmetric mode."""

from __future__ import annotations

import torch

from ...errors import SingularSystemError
from ..system import LinearSystem, Structure
from .base import Step


class ScipyDirect:
    """``scipy.sparse.linalg.splu`` with minimum degree on ``A + A^T`` and diagonal pivots.

    These settings are an order of magnitude faster than SciPy's defaults on normal matrices of meshes. The
    symbolic analysis is repeated at every step (SuperLU's interface keeps none).
    """

    name = "scipy"
    inexact = False

    def prepare(self, structure: Structure) -> None:
        """Builds the full symmetric pattern."""
        self._pattern = structure.normal_pattern
        self._pattern.full  # noqa: B018  (built now, used by every solve)

    def solve(self, system: LinearSystem, damping: torch.Tensor, accuracy: float) -> Step:
        """One damped step; see the protocol."""
        import numpy as np
        import scipy.sparse as sp
        from scipy.sparse.linalg import splu

        values = system.normal_values.cpu().numpy().copy()
        values[self._pattern.offsets[:-1]] += damping.cpu().numpy()
        if not np.isfinite(values).all():
            raise SingularSystemError("the normal matrix is not finite")
        offsets, rows, source = self._pattern.full
        size = self._pattern.num_unknowns
        matrix = sp.csc_matrix((values[source], rows, offsets), (size, size))
        try:
            factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SingularSystemError(f"SuperLU: {error}") from None
        solution = factor.solve(-system.gradient.cpu().numpy())
        if not np.isfinite(solution).all():
            raise SingularSystemError("the normal matrix is singular to working precision")
        change = torch.from_numpy(solution).to(system.gradient)
        return Step(change, torch.zeros_like(change))
