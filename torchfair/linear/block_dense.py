"""Dense solver for matrices that fall into many small blocks of one size, such as those of a batch."""

from __future__ import annotations

import weakref

import numpy as np
import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .checked_right import check_right
from .lower_triangle import LowerTriangle

_PORTION = 200_000  # entries of the blocks that are worked on at once: what stays in the cache


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
        self._room = _Room()
        self._portion = max(1, _PORTION // max(1, unknowns.shape[1] ** 2))

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
        first, second, owner = place[lower.rows], place[columns], owner[columns]
        # Column by column, as LAPACK likes it.
        places = (owner % self._portion * size + np.minimum(first, second)) * size + np.maximum(first, second)
        portion = owner // self._portion
        order = None
        if (np.diff(portion) < 0).any():
            order = np.argsort(portion, kind="stable")
            places = places[order]
        sizes = np.bincount(portion, minlength=-(-blocks // self._portion))
        device = self._unknowns.device
        self._order = None if order is None else torch.from_numpy(order).to(device)
        self._places = torch.from_numpy(places).to(device)
        self._sizes: list[int] = sizes.tolist()

    def factorise(self, system: System, damping: Tensor) -> BlockDenseFactor:
        """See the protocol. The error names the blocks that are not positive definite."""
        count, size = self._unknowns.shape
        values = system.lower_values.double()
        if self._order is not None:
            values = values[self._order]
        diagonals, factors = damping[self._unknowns].double(), self._room.of((count, size, size), values)
        failed = torch.zeros(count, dtype=torch.int32, device=values.device)
        room = values.new_empty(min(self._portion, count), size, size)
        parts = zip(torch.split(values, self._sizes), torch.split(self._places, self._sizes), strict=True)
        for start, (part, places) in zip(range(0, count, self._portion), parts, strict=True):
            chosen = slice(start, start + self._portion)
            blocks = room[: factors[chosen].shape[0]].zero_()
            blocks.view(-1)[places] = part
            blocks.diagonal(dim1=1, dim2=2).add_(diagonals[chosen])
            torch.linalg.cholesky_ex(blocks.mT, out=(factors[chosen].mT, failed[chosen]))
        if bool(failed.any()):
            _refuse(failed > 0)
        factor = BlockDenseFactor(factors.mT, self._unknowns)
        self._room.taken_by(factor, factors)
        return factor


class _Room:
    """Memory for factors, taken again when the last factor is gone: fresh memory costs half as much as the factors.

    Copies of a solver share it.
    """

    def __init__(self) -> None:
        self._owner: weakref.ref[BlockDenseFactor] | None = None
        self._memory: Tensor | None = None

    def of(self, shape: tuple[int, ...], like: Tensor) -> Tensor:
        """Numbers that mean nothing."""
        if self._memory is None or self._memory.shape != shape or (self._owner is not None and self._owner()):
            self._memory = like.new_empty(shape)
        return self._memory

    def taken_by(self, factor: BlockDenseFactor, memory: Tensor) -> None:
        """Keeps the memory of a factor for later ones."""
        self._owner, self._memory = weakref.ref(factor), memory


class BlockDenseFactor:
    """Cholesky factors of the blocks."""

    def __init__(self, factors: Tensor, unknowns: Tensor) -> None:
        self._factors, self._unknowns = factors, unknowns

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        """See the protocol."""
        check_right(right, self._unknowns.numel())
        columns = right if right.ndim == 2 else right[:, None]
        found = torch.linalg.solve_triangular(self._factors, columns[self._unknowns].double(), upper=False)
        found = torch.linalg.solve_triangular(self._factors.mT, found, upper=True)
        finite = torch.isfinite(found).flatten(1).all(1)
        if not bool(finite.all()):
            _refuse(~finite)
        values = torch.empty_like(columns)
        values[self._unknowns] = found.to(values)
        values = values.reshape(right.shape)
        return Solution(values, torch.zeros_like(values))


def _refuse(bad: Tensor) -> None:
    blocks = torch.nonzero(bad).flatten().tolist()
    raise SingularSystemError(f"{len(blocks)} blocks of the matrix are not positive definite, or not finite", blocks)
