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
from .portions import portions

_TOLERANCE = 1e-3
_ENTRIES = 1 << 23


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
    """

    def __init__(self, terms: Sequence[CompiledTerm], layout: Layout, free: Tensor, dtype: torch.dtype) -> None:
        origin = layout.unflatten(torch.zeros(layout.num_unknowns, dtype=dtype, device=free.device))
        self._terms = [compiled.term for compiled in terms]
        matrices, offsets, roots, sizes = [], [], [], []
        for compiled in terms:
            arguments = compiled.term.arguments_at(origin)
            root = compiled.term.roots(compiled.term.values(arguments))
            unknowns = compiled.unknowns
            for elements in portions(root.shape[0], root):
                values, jacobians = compiled.term.linearised(arguments.part(elements))
                matrices.append(_rows(jacobians * root[elements, None, None], unknowns[:, elements], layout))
                offsets.append((values * root[elements, None]).reshape(-1))
            m = values.shape[1]
            sizes.append(root.shape[0] * m)
            roots.append(root.repeat_interleave(m))
        whole = matrices[0] if len(matrices) == 1 else sp.csr_matrix(sp.vstack(matrices, format="csr"))
        self.offset, self._roots = torch.cat(offsets), torch.cat(roots)
        self._sizes: list[int] = sizes
        self._matrix, self._whole = whole, self._to_torch(whole)
        self._mask(free)

    def with_free(self, free: Tensor) -> AffinePart:
        """The same terms with other unknowns (N,) that may move."""
        result = copy.copy(self)
        for stale in ("diagonal", "normal_matrix"):
            result.__dict__.pop(stale, None)
        result._mask(free)
        return result

    def _mask(self, free: Tensor) -> None:
        """Makes columns of fixed unknowns zero; their places stay, so that they can be freed again."""
        self.jacobian, self._free = self._matrix, None
        if not bool(free.all()):
            self._free = free
            self.jacobian = self._matrix.copy()
            self.jacobian.data *= free.cpu().numpy()[self._matrix.indices]
        self._transpose = self._to_torch(sp.csr_matrix(self.jacobian.T))

    @cached_property
    def _products(self) -> sp.csr_matrix:
        return sp.csr_matrix(self._matrix.T @ self._matrix)

    @cached_property
    def normal_matrix(self) -> sp.csr_matrix:
        """``A^T A``, zero at fixed unknowns, a SciPy CSR matrix; made when it is first asked for."""
        products = self._products
        if self._free is None:
            return products
        moves, products = self._free.cpu().numpy(), products.copy()
        rows = np.repeat(np.arange(moves.size), np.diff(products.indptr))
        products.data *= moves[rows] & moves[products.indices]
        return products

    def product(self, vectors: Tensor) -> Tensor:
        """``A^T A`` times vectors (N,) or (N, k)."""
        if self._free is not None:
            vectors = vectors * (self._free if vectors.ndim == 1 else self._free[:, None])
        result: Tensor = self._transpose @ (self._whole @ vectors)
        return result

    def diagonal_blocks(self, first: int, nodes: int, width: int) -> Tensor:
        """(nodes, width, width) diagonal blocks of ``A^T A``, of nodes whose unknowns lie one after the other."""
        columns = [self.jacobian[:, first + a : first + nodes * width : width] for a in range(width)]
        blocks = self.offset.new_empty(nodes, width, width)
        for a, one in enumerate(columns):
            for b, other in enumerate(columns[: a + 1]):
                sums = np.asarray(one.multiply(other).sum(axis=0)).reshape(-1)
                blocks[:, a, b] = blocks[:, b, a] = torch.from_numpy(sums).to(blocks)
        return blocks

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
            values = term.values(term.arguments_at(state))
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
        columns, values = self.jacobian.indices, self.jacobian.data
        squares = np.zeros(self.jacobian.shape[1])
        for start in range(0, values.size, _ENTRIES):  # wide numbers of all columns would be as large as the matrix
            part = slice(start, start + _ENTRIES)
            squares += np.bincount(columns[part], values[part] ** 2, squares.size)
        return torch.from_numpy(squares).to(self.offset)


def _rows(jacobians: Tensor, unknowns: Tensor, layout: Layout) -> sp.csr_matrix:
    """Rows for the Jacobians (n, m, K) of elements with unknowns (K, n), without zeros."""
    n, m, k = jacobians.shape
    columns = unknowns.T.to(torch.int32)[:, None].expand(n, m, k).reshape(-1).cpu().numpy()
    offsets = np.arange(n * m + 1, dtype=np.int32) * k
    matrix = sp.csr_matrix((jacobians.reshape(-1).cpu().numpy(), columns, offsets), (n * m, layout.num_unknowns))
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix
