"""Sparsity of the normal matrix ``J^T J`` and the fixed map that fills it."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
import torch
from torch import Tensor

from ..linear import LowerTriangle
from .affine import AffinePart
from .compiled import CompiledTerm
from .layout import Layout
from .products import ProductSum

Ints = np.ndarray

_PORTION = 200_000  # products


class NormalPattern:
    """Lower triangle of ``J^T J`` in compressed columns, sorted, the diagonal first in each column.

    The pattern is found between nodes (a few unknowns each), which is an order of magnitude cheaper than
    between unknowns; positions of single entries follow by arithmetic. Products of the Jacobian entries of
    an element are summed into place by one fixed sparse matrix; linear terms are added as a constant.

    Attributes:
        lower: Places of the entries.
    """

    def __init__(self, layout: Layout, terms: Sequence[CompiledTerm], affine: AffinePart | None, like: Tensor) -> None:
        self.num_unknowns, self._like = layout.num_unknowns, like
        self._widths = np.concatenate([np.full(n, d, np.int64) for n, d in layout.sizes.values()])
        self._first = np.concatenate([[0], np.cumsum(self._widths)])
        nodes = [term.nodes.cpu().numpy() for term in terms]
        constant = sp.tril(affine.normal_matrix, format="coo") if affine is not None else None
        self._pair_nodes(nodes, constant)
        self._place_columns()
        self._products: ProductSum | None = None
        self._constant: Tensor | None = None
        if terms:
            found = [self._product_places(n, t.widths) for n, t in zip(nodes, terms, strict=True)]
            places, factors = zip(*found, strict=True)
            firsts = [[0] * sum(term.widths) for term in terms]
            self._products = ProductSum(firsts, places, factors, self.lower.rows.size, like)
        if affine is not None and constant is not None:
            self._constant = self._place_constant(constant).to(like)

    def _pair_nodes(self, stencils: Sequence[Ints], constant: sp.coo_matrix | None) -> None:
        """Sorted pairs ``column node <= row node`` of nodes that meet in an element, ``(n, n)`` included."""
        count = self._widths.size
        low, high = [np.arange(count)], [np.arange(count)]
        for nodes in stencils:
            for s in range(nodes.shape[0]):
                low += [np.minimum(nodes[s], nodes[t]) for t in range(s)]
                high += [np.maximum(nodes[s], nodes[t]) for t in range(s)]
        if constant is not None:
            owner = np.repeat(np.arange(count), self._widths)
            low.append(owner[constant.col])
            high.append(owner[constant.row])
        columns, rows = np.concatenate(low), np.concatenate(high)
        pairs = sp.csc_matrix((np.ones(rows.size, np.int8), (rows, columns)), (count, count))
        pairs.sum_duplicates()
        self._pair_rows = pairs.indices.astype(np.int64)
        self._pair_columns = np.repeat(np.arange(count), np.diff(pairs.indptr))
        self._pair_offsets = pairs.indptr
        self._pair_keys = self._pair_columns * count + self._pair_rows

    def _place_columns(self) -> None:
        """Start and stride of every pair of nodes (see :func:`_place`), and the rows of all entries."""
        widths, columns, rows = self._widths, self._pair_columns, self._pair_rows
        row_widths = widths[rows]
        below = np.bincount(columns, row_widths, widths.size).astype(np.int64)  # the diagonal block included
        base = np.concatenate([[0], np.cumsum(widths * below - widths * (widths - 1) // 2)])
        before = np.cumsum(row_widths) - row_widths
        self._start = base[columns] + before - before[self._pair_offsets[:-1]][columns]
        self._stride = (below - 1)[columns]
        all_rows = np.empty(base[-1], np.int64)
        offsets = np.empty(self.num_unknowns + 1, np.int64)
        offsets[-1] = base[-1]
        for j in range(int(widths.max(initial=0))):
            nodes = np.flatnonzero(widths > j)
            offsets[self._first[nodes] + j] = base[nodes] + j * below[nodes] - (j * (j - 1)) // 2
            for i in range(int(widths.max())):
                pairs = np.flatnonzero((widths[columns] > j) & (row_widths > i) & ((rows != columns) | (i >= j)))
                all_rows[_place(self._start[pairs], self._stride[pairs], i, j)] = self._first[rows[pairs]] + i
        self.lower = LowerTriangle(offsets, all_rows)

    def _product_places(self, nodes: Ints, widths: list[int]) -> tuple[Tensor, Tensor | None]:
        """Places ``(pairs, n)`` of the products of local unknowns p >= q, and their factors.

        The factor is 2 where p and q are one unknown, which happens if an element names a node twice.
        """
        first = np.concatenate([[0], np.cumsum(widths)]).tolist()
        places = np.empty((first[-1] * (first[-1] + 1) // 2, nodes.shape[1]), np.int64)
        factors = None
        for t, s in itertools.combinations_with_replacement(range(len(widths)), 2):
            swapped, same = nodes[s] < nodes[t], nodes[s] == nodes[t]
            pairs = self._find(np.maximum(nodes[s], nodes[t]), np.minimum(nodes[s], nodes[t]))
            start, stride = self._start[pairs], self._stride[pairs]
            repeated = s != t and bool(same.any())
            for a, b in itertools.product(range(widths[s]), range(widths[t])):
                p, q = first[s] + a, first[t] + b
                if p < q:
                    continue
                place = _place(start, stride, a, b)
                if s != t:
                    place = np.where(swapped, _place(start, stride, b, a), place)
                if repeated:
                    place = np.where(same, _place(start, stride, max(a, b), min(a, b)), place)
                    if a == b:
                        factors = np.ones(places.shape) if factors is None else factors
                        factors[p * (p + 1) // 2 + q] += same
                places[p * (p + 1) // 2 + q] = place
        return torch.from_numpy(places), None if factors is None else torch.from_numpy(factors)

    def _find(self, rows: Ints, columns: Ints) -> Ints:
        """Numbers of pairs of nodes ``rows >= columns``."""
        found: Ints = np.searchsorted(self._pair_keys, columns * self._widths.size + rows)
        return found

    def _place_constant(self, lower: sp.coo_matrix) -> Tensor:
        """(nnz,) the lower triangle of a constant matrix."""
        owner = np.repeat(np.arange(self._widths.size), self._widths)
        rows, columns = owner[lower.row], owner[lower.col]
        pairs = self._find(rows, columns)
        values = np.zeros(self.lower.rows.size)
        i, j = lower.row - self._first[rows], lower.col - self._first[columns]
        values[_place(self._start[pairs], self._stride[pairs], i, j)] = lower.data
        return torch.from_numpy(values)

    def fits(self, affine: AffinePart | None) -> bool:
        """Whether the constant matrix of these linear terms has its place in the pattern."""
        if affine is None:
            return True
        keys = self._keys(affine.normal_matrix.tocoo())
        places = np.searchsorted(self._pair_keys, keys).clip(max=self._pair_keys.size - 1)
        return bool((self._pair_keys[places] == keys).all())

    def _keys(self, matrix: sp.coo_matrix) -> Ints:
        """Keys of the pairs of nodes of the lower triangle of a matrix between unknowns."""
        owner = np.repeat(np.arange(self._widths.size), self._widths)
        lower = matrix.row >= matrix.col
        keys: Ints = owner[matrix.col[lower]] * self._widths.size + owner[matrix.row[lower]]
        return keys

    def with_constant(self, affine: AffinePart | None) -> NormalPattern:
        """The same pattern with other linear terms, which must fit."""
        result = copy.copy(self)
        result._constant = None
        if affine is not None:
            result._constant = self._place_constant(sp.tril(affine.normal_matrix, format="coo")).to(self._like)
        return result

    def assemble(self, jacobians: Sequence[Tensor]) -> Tensor:
        """(nnz,) values of the lower triangle for element Jacobians ``(m, K, n)`` of the terms."""
        values = self._like.new_zeros(self.lower.rows.size) if self._products is None else self._products(jacobians)
        return values if self._constant is None else values.add_(self._constant)

    def assemble_members(self, jacobians: Sequence[Tensor], members: int) -> Tensor:
        """(members, nnz) the same for the members of a batch, whose elements lie one after the other.

        Few members at a time: their products stay in the cache.
        """
        parts = [jacobian.view(*jacobian.shape[:2], members, -1) for jacobian in jacobians]
        shape = (members, self.lower.rows.size)
        values = self._like.new_zeros(shape) if self._products is None else self._like.new_empty(shape)
        if self._products is not None:
            portion = max(1, _PORTION // max(1, self._products.length))
            for start in range(0, members, portion):
                some = [part[:, :, start : start + portion].transpose(2, 3).flatten(2) for part in parts]
                out = values[start : start + portion]
                out.T.copy_(self._products(some, out.shape[0]).view(-1, out.shape[0]))
        return values if self._constant is None else values.add_(self._constant)


def _place(start: Ints, stride: Ints, i: Ints | int, j: Ints | int) -> Ints:
    """Place of the entry (component i of the row node, component j of the column node) of pairs of nodes.

    Column j of a node holds one entry less than column j - 1.
    """
    result: Ints = start + j * stride + (i - (j * (j - 1)) // 2)
    return result
