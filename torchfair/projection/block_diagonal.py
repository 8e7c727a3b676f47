"""Diagonal blocks of the normal matrix, one for each node: what conjugate gradients are preconditioned with."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..linear.sparse import csr_matrix
from .affine import AffinePart
from .compiled import CompiledTerm
from .layout import Layout
from .products import ProductSum


class BlockDiagonal:
    """A block diagonal matrix: the blocks ``(d, d)`` of all nodes, row by row, one after the other.

    This is also the order of the values of that matrix in compressed rows.
    """

    def __init__(self, layout: Layout, terms: Sequence[CompiledTerm], affine: AffinePart | None, like: Tensor) -> None:
        self._layout, self._like = layout, like
        starts, mirror, columns, lengths, size = [], [], [], [], 0
        for name, (n, d) in layout.sizes.items():
            node, component = torch.arange(n)[:, None, None], torch.arange(d)
            a, b = component[:, None], component[None, :]
            starts.append(size + torch.arange(n) * d * d)
            mirror.append((size + node * d * d + torch.maximum(a, b) * d + torch.minimum(a, b)).flatten())
            columns.append((layout.offset(name) + node * d + b.expand(d, d)).flatten())
            lengths.append(torch.full((n * d,), d))
            size += n * d * d
        offsets = torch.cat([torch.zeros(1, dtype=torch.int64), torch.cat(lengths).cumsum(0)])
        self._rows = torch.repeat_interleave(torch.cat(lengths))
        self._starts = torch.cat(starts)
        self._mirror, self._columns, self._offsets = (
            index.to(like.device, torch.int32) for index in (torch.cat(mirror), torch.cat(columns), offsets)
        )
        self._products = None
        if terms:
            firsts = [[p - a for p, a in enumerate(_components(term))] for term in terms]
            places = [self._places(term) for term in terms]
            self._products = ProductSum(firsts, places, [None] * len(terms), size, like)
        self._constant = None if affine is None else self._pick(affine).to(like)

    def _places(self, term: CompiledTerm) -> Tensor:
        """Places of the products of two unknowns of one stencil row, lower triangles."""
        nodes = term.nodes.cpu()
        rows = [
            self._starts[nodes[row]] + (a * width + b)
            for row, width in enumerate(term.widths)
            for a in range(width)
            for b in range(a + 1)
        ]
        return torch.stack(rows)

    def _pick(self, affine: AffinePart) -> Tensor:
        """The blocks of the constant normal matrix."""
        rows, columns = self._rows.numpy().copy(), self._columns.cpu().numpy().copy()
        return torch.from_numpy(affine.normal_matrix[rows, columns]).reshape(-1)

    def values(self, jacobians: Sequence[Tensor]) -> Tensor:
        """Blocks of ``J^T J`` for element Jacobians ``(m, K, n)``, flat.

        Where an element names a node twice, the mixed products are left out.
        """
        if self._products is None:
            values = self._like.new_zeros(self._mirror.shape[0])
        else:
            values = self._products(jacobians).index_select(0, self._mirror)
        return values if self._constant is None else values.add_(self._constant)

    def split(self, values: Tensor) -> dict[str, Tensor]:
        """Flat blocks as ``(n, d, d)`` by block of variables (views)."""
        sizes = self._layout.sizes
        parts = torch.split(values, [n * d * d for n, d in sizes.values()])
        return {name: part.view(n, d, d) for (name, (n, d)), part in zip(sizes.items(), parts, strict=True)}

    def matrix(self, values: Tensor) -> Tensor:
        """Flat blocks as a CSR matrix."""
        size = self._layout.num_unknowns
        return csr_matrix(self._offsets, self._columns, values, (size, size))


def _components(term: CompiledTerm) -> list[int]:
    return [component for width in term.widths for component in range(width)]
