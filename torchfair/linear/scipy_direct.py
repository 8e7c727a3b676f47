"""Sparse direct solver that is always there: SuperLU in symmetric mode."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..errors import SingularSystemError
from .direct import SparseDirect, Substitution
from .lower_triangle import LowerTriangle


class ScipyDirect(SparseDirect):
    """``scipy.sparse.linalg.splu`` with minimum degree on ``A + A^T`` and diagonal pivots.

    These settings are an order of magnitude faster than SciPy's defaults on normal matrices of meshes. The
    symbolic analysis is repeated for every factor (SuperLU's interface keeps none).
    """

    name = "scipy"

    def analyse(self, lower: LowerTriangle) -> None:
        """Builds the full symmetric pattern."""
        self._full, self._size = lower.full, lower.size

    def factor(self, values: np.ndarray) -> Substitution:
        """Factors a matrix of the pattern; see ``SparseDirect``."""
        from scipy.sparse.linalg import splu

        offsets, rows, source = self._full
        matrix = sp.csc_matrix((values[source], rows, offsets), (self._size, self._size))
        try:
            factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SingularSystemError(f"SuperLU: {error}") from None
        return lambda right, accuracy: factor.solve(right)
