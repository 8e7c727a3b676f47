"""One solver for all blocks of a matrix that have the same pattern: analysed once, factorised one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .checked_right import check_right
from .direct import TIGHTEST, DirectFactor, SparseDirect
from .lower_triangle import LowerTriangle


class BlockByBlock:
    """A sparse direct solver for every block.

    One analysis serves all, and a block that is singular is known by its number.

    Args:
        unknowns: (blocks, n) the unknowns of each block; every unknown is in one of them, the matrix has no entries
            between two of them, and in all of them entries are in the same places.
        solver: For one of them.
    """

    inexact = False

    def __init__(self, unknowns: Tensor, solver: SparseDirect) -> None:
        self._unknowns, self._solver, self.name = unknowns, solver, solver.name
        self._known: LowerTriangle | None = None

    def prepare(self, pattern: Pattern) -> None:
        """Analyses the first block; see the protocol."""
        if self._known is pattern.lower:
            return
        lower, unknowns = pattern.lower, self._unknowns.cpu().numpy()
        count, size = unknowns.shape
        owner, place = np.empty((2, unknowns.size), np.int64)
        owner[unknowns.ravel()], place[unknowns.ravel()] = np.divmod(np.arange(unknowns.size), size)
        columns = np.repeat(np.arange(unknowns.size), np.diff(lower.offsets))
        first, second = place[lower.rows], place[columns]
        keys = (owner[columns] * size + np.minimum(first, second)) * size + np.maximum(first, second)
        self._order = None if (np.diff(keys) > 0).all() else torch.from_numpy(np.argsort(keys))
        keys = (keys if self._order is None else keys[self._order.numpy()])[: keys.size // count]
        offsets = np.searchsorted(keys // size, np.arange(size + 1))
        single = SimpleNamespace(num_unknowns=size, device=pattern.device, lower=LowerTriangle(offsets, keys % size))
        self._solver.prepare(single)
        self._single, self._known = single, lower

    def factorise(self, system: System, damping: Tensor) -> BlockFactors:
        """See the protocol. The error names the blocks that are not positive definite."""
        values = system.lower_values.cpu()
        if self._order is not None:
            values = values[self._order]
        parts = zip(values.view(self._unknowns.shape[0], -1), damping.cpu()[self._unknowns.cpu()], strict=True)
        factors: list[DirectFactor] = []
        failed = []
        for number, (part, diagonal) in enumerate(parts):
            one = SimpleNamespace(pattern=self._single, lower_values=part)
            try:
                factors.append(self._solver.factorise(one, diagonal))
            except SingularSystemError:
                failed.append(number)
        _refuse(failed)
        return BlockFactors(factors, self._unknowns)


class BlockFactors:
    """A factor for each block."""

    def __init__(self, factors: Sequence[DirectFactor], unknowns: Tensor) -> None:
        self._factors, self._unknowns = factors, unknowns

    def solve(self, right: Tensor, accuracy: float = TIGHTEST) -> Solution:
        """See the protocol."""
        check_right(right, self._unknowns.numel())
        values, failed = torch.empty_like(right), []
        for number, (factor, unknowns) in enumerate(zip(self._factors, self._unknowns, strict=True)):
            try:
                values[unknowns] = factor.solve(right[unknowns], accuracy).values
            except SingularSystemError:
                failed.append(number)
        _refuse(failed)
        return Solution(values, torch.zeros_like(values))


def _refuse(failed: list[int]) -> None:
    if failed:
        message = f"{len(failed)} blocks of the matrix are not positive definite, or not finite"
        raise SingularSystemError(message, failed)
