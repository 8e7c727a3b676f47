"""Sparse direct solver that is always there: SuperLU in symmetric mode."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ...errors import SingularSystemError
from ..system import Structure
from .direct import SparseDirect, Substitution


class ScipyDirect(SparseDirect):
    """``scipy.sparse.linalg.splu`` with minimum degree on ``A + A^T`` and diagonal pivots.

    These settings are an order of magnitude faster than SciPy's defaults on normal matrices of meshes. The
    symbolic analysis is repeated at every step (SuperLU's interface keeps none).
    """

    name = "scipy"

    def prepare(self, structure: Structure) -> None:
        """Builds the full symmetric pattern."""
        self._pattern = structure.normal_pattern.full
        self._size = structure.num_unknowns

    def factorise(self, values: np.ndarray, accuracy: float) -> Substitution:
        """See :class:`SparseDirect`."""
        from scipy.sparse.linalg import splu

        offsets, rows, source = self._pattern
        matrix = sp.csc_matrix((values[source], rows, offsets), (self._size, self._size))
        try:
            factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SingularSystemError(f"SuperLU: {error}") from None
        return factor.solve
