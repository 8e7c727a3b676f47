"""All linear terms of a problem as one constant sparse system."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import torch
from torch import Tensor

from ..linear.sparse import csr_matrix
from .compiled import CompiledTerm
from .layout import Layout, State

_TOLERANCE = 1e-3


class AffinePart:
    """The linear terms: residuals ``A x + b`` of the flat vector x, scaled by the roots of their weights.

    Zeros of the element Jacobians are dropped, for example between different coordinates of umbrella vectors.

    Args:
        terms: Linear terms, at least one.
        layout: Blocks of variables.
        free: (N,) unknowns that may move.
        dtype: Of the blocks.

    Attributes:
        offset: (rows,) b.
        jacobian: ``A`` with zero columns at fixed unknowns, a SciPy CSR matrix.
        normal_matrix: ``A^T A``, zero at fixed unknowns, likewise.
    """

    def __init__(self, terms: Sequence[CompiledTerm], layout: Layout, free: Tensor, dtype: torch.dtype) -> None:
        origin = layout.unflatten(torch.zeros(layout.num_unknowns, dtype=dtype, device=free.device))
        self._terms = [compiled.term for compiled in terms]
        matrices, offsets, roots = [], [], []
        for compiled in terms:
            values, jacobians = compiled.term.linearised(compiled.term.arguments(origin))
            root = compiled.term.roots(values)
            n, m, k = jacobians.shape
            entries = (jacobians * root[:, None, None]).cpu().numpy()
            columns = np.repeat(compiled.unknowns.T.cpu().numpy()[:, None], m, axis=1)
            rows = np.repeat(np.arange(n * m), k)
            matrices.append(sp.csr_matrix((entries.ravel(), (rows, columns.ravel())), (n * m, layout.num_unknowns)))
            offsets.append((values * root[:, None]).reshape(-1))
            roots.append(root.repeat_interleave(m))
        whole = sp.csr_matrix(sp.vstack(matrices))
        whole.eliminate_zeros()
        self.offset, self._roots = torch.cat(offsets), torch.cat(roots)
        self._sizes = [offset.shape[0] for offset in offsets]
        self._matrix, self._whole = whole, self._to_torch(whole)
        self._products = sp.csr_matrix(whole.T @ whole)
        self._mask(free)

    def with_free(self, free: Tensor) -> AffinePart:
        """The same terms with other unknowns (N,) that may move."""
        result = copy.copy(self)
        result.__dict__.pop("diagonal", None)
        result._mask(free)
        return result

    def _mask(self, free: Tensor) -> None:
        """Makes columns of fixed unknowns zero; their places stay, so that they can be freed again."""
        self.jacobian, self.normal_matrix = self._matrix, self._products
        if not bool(free.all()):
            moves = free.cpu().numpy()
            self.jacobian, self.normal_matrix = self._matrix.copy(), self._products.copy()
            self.jacobian.data *= moves[self._matrix.indices]
            rows = np.repeat(np.arange(moves.size), np.diff(self._products.indptr))
            self.normal_matrix.data *= moves[rows] & moves[self._products.indices]
        self._transpose = self._to_torch(sp.csr_matrix(self.jacobian.T))

    def _to_torch(self, matrix: sp.csr_matrix) -> Tensor:
        offsets, columns = torch.from_numpy(matrix.indptr), torch.from_numpy(matrix.indices)
        return csr_matrix(offsets, columns, torch.from_numpy(matrix.data), matrix.shape).to(self.offset.device)

    def residual(self, flat: Tensor) -> Tensor:
        """(rows,) scaled residuals; half the sum of their squares is the merit of the linear terms."""
        return self.change(flat).add_(self.offset)

    def member_sums(self, rows: Tensor, members: int) -> Tensor:
        """(members,) sums of (rows,) values over the rows of each member of a batch."""
        return torch.stack([part.view(members, -1).sum(1) for part in torch.split(rows, self._sizes)]).sum(0)

    def with_members(self, rows: Tensor, others: Tensor, chosen: Tensor, members: int) -> Tensor:
        """(rows,) values, those of the chosen members of a batch from others."""
        result = rows.clone()
        for new, old in zip(torch.split(result, self._sizes), torch.split(others, self._sizes), strict=True):
            new.view(members, -1)[chosen] = old.view(members, -1)[chosen]
        return result

    def member_owners(self, members: int) -> Tensor:
        """(rows,) number of the member that a row belongs to."""
        every = torch.arange(members, device=self.offset.device)
        return torch.cat([every.repeat_interleave(size // members) for size in self._sizes])

    def change(self, step: Tensor) -> Tensor:
        """(rows,) by how much a step (N,) changes the scaled residuals."""
        result: Tensor = self._whole @ step
        return result

    def by_term(self, residual: Tensor, squares: Tensor) -> list[tuple[Tensor, Tensor]]:
        """For each term residuals, and sums of ``A_ij^2`` times ``squares`` (N,), both without weights."""
        inverse = torch.where(self._roots > 0.0, 1.0 / self._roots, 0.0)
        changes = self._to_torch(self.jacobian.power(2)) @ squares * inverse.square()
        return list(zip(torch.split(residual * inverse, self._sizes), torch.split(changes, self._sizes), strict=True))

    def misfit(self, state: State, flat: Tensor) -> str | None:
        """Name of a term whose residuals at a state are not those of the linear map: it is not linear."""
        sizes = abs(self._matrix) @ flat.abs().cpu().numpy() + self.offset.abs().cpu().numpy()
        scales = torch.split(torch.from_numpy(sizes), self._sizes)
        for term, mine, scale in zip(self._terms, torch.split(self.residual(flat), self._sizes), scales, strict=True):
            values = term.values(term.arguments(state))
            own = (values * term.roots(values)[:, None]).reshape(-1)
            if own.numel() and not float((own - mine).abs().max()) <= _TOLERANCE * float(scale.max()):
                return term.name
        return None

    def gradient(self, residual: Tensor) -> Tensor:
        """``A^T r``, zero at fixed unknowns."""
        result: Tensor = self._transpose @ residual
        return result

    @cached_property
    def diagonal(self) -> Tensor:
        """(N,) of ``A^T A``."""
        squares = self.jacobian.multiply(self.jacobian).sum(axis=0)
        return torch.from_numpy(np.asarray(squares).reshape(-1)).to(self.offset)
