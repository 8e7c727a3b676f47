"""Dense solver for matrices that fall into many small blocks of one size, such as those of a batch."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .lower_triangle import LowerTriangle


class BlockDense:
    """Cholesky factors of all blocks at once, in double precision.

    Args:
        unknowns: (blocks, n) the unknowns of each block; every unknown is in one of them, and the matrix has no entries
            between two of them.
    """

    name = "dense blocks"
    inexact = False

    def __init__(self, unknowns: Tensor) -> None:
        self._unknowns = unknowns
        self._known: LowerTriangle | None = None

    def prepare(self, pattern: Pattern) -> None:
        """Finds the place of every entry in its block; see the protocol."""
        if self._known is pattern.lower:
            return
        self._known = lower = pattern.lower
        blocks, size = self._unknowns.shape
        flat = self._unknowns.cpu().numpy().ravel()
        owner, place = np.empty(flat.size, np.int64), np.empty(flat.size, np.int64)
        owner[flat], place[flat] = np.divmod(np.arange(flat.size), size)
        columns = np.repeat(np.arange(flat.size), np.diff(lower.offsets))
        places = (owner[columns] * size + place[lower.rows]) * size + place[columns]
        mirrored = (owner[columns] * size + place[columns]) * size + place[lower.rows]
        device = self._unknowns.device
        self._places, self._mirrored = (torch.from_numpy(index).to(device) for index in (places, mirrored))
        self._shape = (blocks, size, size)

    def factorise(self, system: System, damping: Tensor) -> BlockDenseFactor:
        """See the protocol."""
        values = system.lower_values.double()
        blocks = values.new_zeros(self._shape)
        for places in (self._places, self._mirrored):
            blocks.view(-1)[places] = values
        blocks.diagonal(dim1=1, dim2=2).add_(damping[self._unknowns].double())
        factors, failed = torch.linalg.cholesky_ex(blocks)
        if bool(failed.any()):
            raise SingularSystemError(f"{int((failed > 0).sum())} blocks of the matrix are not positive definite")
        return BlockDenseFactor(factors, self._unknowns)


class BlockDenseFactor:
    """Cholesky factors of the blocks."""

    def __init__(self, factors: Tensor, unknowns: Tensor) -> None:
        self._factors, self._unknowns = factors, unknowns

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        """See the protocol."""
        columns = right if right.ndim == 2 else right[:, None]
        found = torch.cholesky_solve(columns[self._unknowns].double(), self._factors)
        if not bool(torch.isfinite(found).all()):
            raise SingularSystemError("the matrix is not finite, or singular to working precision")
        values = torch.empty_like(columns)
        values[self._unknowns] = found.to(values)
        values = values.reshape(right.shape)
        return Solution(values, torch.zeros_like(values))
