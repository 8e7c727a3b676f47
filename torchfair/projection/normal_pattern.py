"""Sparsity of the normal matrix ``J^T J`` and the fixed map that fills it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import torch
from torch import Tensor

from .layout import Layout
from .sparse import scatter_matrix

TermPattern = tuple[Tensor, list[int], Tensor, bool]  # nodes (k, n), widths, unknowns (K, n), linear


class NormalPattern:
    """Lower triangle of ``J^T J`` in compressed columns, sorted, the diagonal first in each column.

    The pattern is found between nodes (a few unknowns each), which is an order of magnitude cheaper than
    between unknowns; positions of single entries follow by arithmetic. Products of the Jacobian entries of
    an element are summed into place by one fixed sparse matrix; terms that are linear are added once.

    Attributes:
        offsets: (N+1,) start of each column.
        rows: (nnz,) row of each entry.
    """

    def __init__(self, layout: Layout, terms: Sequence[TermPattern], dtype: torch.dtype) -> None:
        self.num_unknowns = layout.num_unknowns
        self._dtype = dtype
        self._terms = terms
        sizes = np.concatenate([np.full(n, d, np.int64) for n, d in layout.sizes.values()])
        self._widths = sizes
        self._first = np.concatenate([[0], np.cumsum(sizes)])
        self._pair_nodes(terms)
        self._place_columns()
        self._scatter = self._build_scatter()
        self._constant: Tensor | None = None

    def _pair_nodes(self, terms: Sequence[TermPattern]) -> None:
        count = self._widths.size
        pattern = sp.identity(count, dtype=np.int8, format="csr")
        for nodes, _, _, _ in terms:
            k, n = nodes.shape
            rows = np.repeat(np.arange(n), k)
            incidence = sp.csr_matrix((np.ones(k * n, np.int8), (rows, nodes.T.reshape(-1).cpu().numpy())), (n, count))
            incidence.data[:] = 1
            product = (incidence.T @ incidence).tocsr()
            product.data[:] = 1
            pattern = (pattern + product).tocsr()
            pattern.data[:] = 1
        lower = sp.tril(pattern, format="csc")
        lower.sort_indices()
        self._node_rows = lower.indices.astype(np.int64)
        self._node_columns = np.repeat(np.arange(count), np.diff(lower.indptr)).astype(np.int64)
        self._node_starts = lower.indptr.astype(np.int64)
        self._keys = self._node_columns * count + self._node_rows

    def _place_columns(self) -> None:
        """Positions of scalar entries from node pairs; see :meth:`_position`."""
        widths, columns = self._widths, self._node_columns
        row_widths = np.where(self._node_rows == columns, 0, widths[self._node_rows])
        running = np.cumsum(row_widths)
        before = running - row_widths
        self._ahead = before - before[self._node_starts[:-1]][columns]  # unknowns of earlier off-diagonal rows
        below = np.bincount(columns, row_widths, widths.size).astype(np.int64)  # unknowns under the diagonal block
        entries = widths * (widths + 1) // 2 + widths * below
        self._base = np.concatenate([[0], np.cumsum(entries)])
        self._column_length = widths + below
        self.rows = np.empty(self._base[-1], np.int64)
        offsets = np.empty(self.num_unknowns + 1, np.int64)
        offsets[-1] = self._base[-1]
        pairs = np.arange(columns.size)
        for j in range(int(widths.max(initial=0))):
            nodes = np.flatnonzero(widths > j)
            offsets[self._first[nodes] + j] = self._start(nodes, j)
            for i in range(int(widths.max())):
                here = pairs[(widths[columns] > j) & (widths[self._node_rows] > i)]
                here = here[(self._node_rows[here] != columns[here]) | (i >= j)]
                self.rows[self._position(here, i, j)] = self._first[self._node_rows[here]] + i
        self.offsets = offsets

    def _start(self, node: np.ndarray, j: np.ndarray | int) -> np.ndarray:
        result: np.ndarray = self._base[node] + j * self._column_length[node] - (j * (j - 1)) // 2
        return result

    def _position(self, pair: np.ndarray, i: np.ndarray | int, j: np.ndarray | int) -> np.ndarray:
        """Place of the entry (component i of the pair's row node, component j of its column node)."""
        column = self._node_columns[pair]
        start = self._start(column, j)
        diagonal = self._node_rows[pair] == column
        result: np.ndarray = np.where(diagonal, start + i - j, start + self._widths[column] - j + self._ahead[pair] + i)
        return result

    def _build_scatter(self) -> Tensor | None:
        """The fixed matrix that sums products of Jacobian entries of the non-linear terms."""
        positions, factors = [], []
        for nodes, widths, _, linear in self._terms:
            if linear:
                continue
            place, factor = self._product_positions(nodes.cpu().numpy(), widths)
            positions.append(place)
            factors.append(factor)
        if not positions:
            return None
        device = self._terms[0][2].device
        index = torch.from_numpy(np.concatenate(positions)).to(device)
        weights = torch.from_numpy(np.concatenate(factors)).to(device, self._dtype)
        return scatter_matrix(index, int(self._base[-1]), self._dtype, weights)

    def _product_positions(self, nodes: np.ndarray, widths: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Places of the products of local unknowns (p, q), p >= q, and 2 where both are one unknown."""
        count = self._widths.size
        owner = np.repeat(np.arange(len(widths)), widths)
        component = np.concatenate([np.arange(w) for w in widths])
        pair_of: dict[tuple[int, int], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        places, factors = [], []
        for p in range(owner.size):
            for q in range(p + 1):
                s, t = int(owner[p]), int(owner[q])
                if (s, t) not in pair_of:
                    low, high = np.minimum(nodes[s], nodes[t]), np.maximum(nodes[s], nodes[t])
                    pair = np.searchsorted(self._keys, low * count + high)
                    pair_of[s, t] = (pair, nodes[s] < nodes[t], nodes[s] == nodes[t])
                pair, swapped, same = pair_of[s, t]
                a, b = component[p], component[q]
                i = np.where(same, max(a, b), np.where(swapped, b, a))
                j = np.where(same, min(a, b), np.where(swapped, a, b))
                places.append(self._position(pair, i, j))
                factors.append(np.where(same & (a == b) & (p != q), 2.0, 1.0))
        return np.concatenate(places), np.concatenate(factors)

    def assemble(self, jacobians: Sequence[Tensor]) -> Tensor:
        """(nnz,) values of the lower triangle for element Jacobians ``(m, K, n)``."""
        if self._constant is None:
            self._constant = self._assemble_linear(jacobians)
        if self._scatter is None:
            return self._constant
        products = []
        for (_, _, _, linear), jacobian in zip(self._terms, jacobians, strict=True):
            if not linear:
                p, q = torch.tril_indices(jacobian.shape[1], jacobian.shape[1], device=jacobian.device)
                total = jacobian[0][p] * jacobian[0][q]
                for row in jacobian[1:]:
                    total.addcmul_(row[p], row[q])
                products.append(total.reshape(-1))
        return self._constant + self._scatter @ torch.cat(products)

    def _assemble_linear(self, jacobians: Sequence[Tensor]) -> Tensor:
        total = np.zeros(self._base[-1])
        keys = np.repeat(np.arange(self.num_unknowns), np.diff(self.offsets)) * self.num_unknowns + self.rows
        for (_, _, unknowns, linear), jacobian in zip(self._terms, jacobians, strict=True):
            if not linear:
                continue
            m, k, n = jacobian.shape
            values = jacobian.permute(0, 2, 1).reshape(-1).cpu().numpy()
            columns = unknowns.T.expand(m, -1, -1).reshape(-1).cpu().numpy()
            rows = np.repeat(np.arange(m * n), k)
            matrix = sp.csr_matrix((values, (rows, columns)), (m * n, self.num_unknowns))
            product = sp.tril(matrix.T @ matrix, format="csc")
            product.eliminate_zeros()
            product_columns = np.repeat(np.arange(self.num_unknowns), np.diff(product.indptr)).astype(np.int64)
            places = np.searchsorted(keys, product_columns * self.num_unknowns + product.indices)
            np.add.at(total, places, product.data)
        return torch.from_numpy(total).to(jacobians[0].device, self._dtype)

    @cached_property
    def full(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Column offsets, rows and source positions of the full symmetric matrix in compressed columns."""
        numbers = np.arange(1, self.rows.size + 1)
        lower = sp.csc_matrix((numbers, self.rows, self.offsets), (self.num_unknowns, self.num_unknowns))
        upper = sp.triu(lower.T, k=1, format="csc")
        both = (lower + upper).tocsc()
        both.sort_indices()
        return both.indptr, both.indices, both.data - 1
