"""Diagonal blocks of the normal matrix, one for each node: what conjugate gradients are preconditioned with."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..linear.sparse import csr_matrix
from .affine import AffinePart
from .layout import Layout
from .node_sums import Felt, NodeSums


class BlockDiagonal:
    """A block diagonal matrix: the blocks ``(d, d)`` of all nodes, row by row, one after the other.

    This is also the order of the values of that matrix in compressed rows.
    """

    def __init__(self, layout: Layout, sums: NodeSums, affine: AffinePart | None, like: Tensor) -> None:
        self._layout, self._sums, self._affine, self._like = layout, sums, affine, like
        columns, lengths, self._starts, size = [], [], {}, 0
        for name, (n, d) in layout.sizes.items():
            component, width = torch.arange(d, dtype=torch.int32), torch.tensor(d, dtype=torch.int32)
            node = layout.offset(name) + torch.arange(n, dtype=torch.int32)[:, None, None] * width
            columns.append((node + component.expand(d, d)).flatten())
            lengths.append(width.expand(n * d))
            self._starts[layout.offset(name)] = size, n, d
            size += n * d * d
        self._size = size
        self._known: dict[int, Tensor] = {}
        offsets = torch.cat([torch.zeros(1, dtype=torch.int32), torch.cat(lengths).cumsum(0, dtype=torch.int32)])
        self._columns, self._offsets = torch.cat(columns).to(like.device), offsets.to(like.device)

    def values(self, jacobians: Sequence[Tensor], felt: Felt | None = None) -> Tensor:
        """Blocks of ``J^T J`` for element Jacobians ``(m, K, n)``, flat; ``felt`` as for :class:`NodeSums`.

        Where an element names a node twice, the mixed products are left out.
        """
        values = self._like.new_zeros(self._size)
        for first, a, b, entries in self._sums.blocks(jacobians, felt):
            here = self._block(values, first)
            here[:, a, b] = entries
        if self._affine is not None:
            for first, (_, n, d) in self._starts.items():
                self._block(values, first).add_(self._constant(first, n, d))
        for first, (_, _, d) in self._starts.items():
            here = self._block(values, first)
            for a in range(d):
                for b in range(a):
                    here[:, b, a] = here[:, a, b]
        return values

    def _constant(self, first: int, n: int, d: int) -> Tensor:
        """The blocks of linear terms, found once."""
        if first not in self._known and self._affine is not None:
            self._known[first] = self._affine.diagonal_blocks(first, n, d)
        return self._known[first]

    def _block(self, values: Tensor, first: int) -> Tensor:
        start, n, d = self._starts[first]
        return values[start : start + n * d * d].view(n, d, d)

    def split(self, values: Tensor) -> dict[str, Tensor]:
        """Flat blocks as ``(n, d, d)`` by block of variables (views)."""
        sizes = self._layout.sizes
        parts = torch.split(values, [n * d * d for n, d in sizes.values()])
        return {name: part.view(n, d, d) for (name, (n, d)), part in zip(sizes.items(), parts, strict=True)}

    def matrix(self, values: Tensor) -> Tensor:
        """Flat blocks as a CSR matrix."""
        size = self._layout.num_unknowns
        return csr_matrix(self._offsets, self._columns, values, (size, size))
