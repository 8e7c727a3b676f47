"""Places of the entries of a symmetric sparse matrix."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

Ints = np.ndarray


class LowerTriangle:
    """Lower triangle in compressed columns, rows ascending, the diagonal entry first in each column.

    Attributes:
        offsets: (N+1,) start of each column.
        rows: (nnz,) row of each entry.
    """

    def __init__(self, offsets: Ints, rows: Ints) -> None:
        self.offsets, self.rows = offsets, rows

    @property
    def size(self) -> int:
        """N."""
        return self.offsets.size - 1

    def equals(self, other: LowerTriangle) -> bool:
        """Whether the other one has entries in the same places."""
        if self.rows is other.rows:
            return True
        return np.array_equal(self.offsets, other.offsets) and np.array_equal(self.rows, other.rows)

    @property
    def diagonal(self) -> Ints:
        """(N,) positions of the diagonal entries."""
        positions: Ints = self.offsets[:-1]
        return positions

    def matrix(self, values: Ints) -> sp.csc_matrix:
        """The lower triangle with given values (nnz,)."""
        return sp.csc_matrix((values, self.rows, self.offsets), (self.size, self.size))

    @cached_property
    def full(self) -> tuple[Ints, Ints, Ints]:
        """Column offsets, rows and source positions of the full symmetric matrix in compressed columns."""
        lower = self.matrix(np.arange(1, self.rows.size + 1))
        upper = sp.triu(lower.T, k=1, format="csc")
        both = (lower + upper).tocsc()
        both.sort_indices()
        return both.indptr, both.indices, both.data - 1
