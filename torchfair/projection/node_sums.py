"""Sums over elements into the nodes they name: vectors, and diagonal blocks of the normal matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from ..linear.sparse import scatter_matrix
from .compiled import CompiledTerm
from .layout import Layout

Felt = Sequence[Tensor | None]


class _Entry(NamedTuple):
    """Stencil rows of one term in one block: number of the term, first local unknown, nodes (n, rows)."""

    term: int
    first: int
    nodes: Tensor

    @property
    def rows(self) -> int:
        return self.nodes.shape[1]


class _Block(NamedTuple):
    """A block of variables with all that is summed into it: by a matrix, or by the nodes of those that are felt."""

    nodes: int
    width: int
    start: int
    entries: list[_Entry]
    matrix: Tensor
    partial: list[_Entry]


class NodeSums:
    """One fixed sparse matrix for each block, between nodes and the stencil rows that name them.

    It sums one component after the other, so that index and memory are a small fraction of those between unknowns.

    Args:
        layout: Blocks of variables.
        terms: Those that are summed.
        like: A tensor of the dtype and device of the blocks.
        partial: For every term, whether only some of its elements are summed, others every time.
    """

    def __init__(
        self, layout: Layout, terms: Sequence[CompiledTerm], like: Tensor, partial: Sequence[bool] | None = None
    ) -> None:
        self._like, self._size = like, layout.num_unknowns
        self._blocks: list[_Block] = []
        for name, (count, width) in layout.sizes.items():
            entries: list[_Entry] = []
            some: list[_Entry] = []
            for number, compiled in enumerate(terms):
                first = 0
                for other, nodes in compiled.term.stencil:
                    if other == name:
                        (some if partial and partial[number] else entries).append(_Entry(number, first, nodes))
                    first += nodes.shape[1] * layout.sizes[other][1]
            if entries or some:
                index = [entry.nodes.T.reshape(-1).int() for entry in entries]
                whole = torch.cat([like.new_zeros(0, dtype=torch.int32), *index])
                matrix = scatter_matrix(whole, count, like.dtype)
                self._blocks.append(_Block(count, width, layout.offset(name), entries, matrix, some))

    def vector(
        self, local: Sequence[Tensor], factors: Sequence[Tensor] | None = None, felt: Felt | None = None
    ) -> Tensor:
        """(N,) sums of local vectors.

        Args:
            local: For every term ``(K, n)``; or ``(m, K, n)``, whose components are multiplied by factors and summed.
            factors: For every term ``(m, n)`` or ``(m, K, n)``.
            felt: For every term the numbers of the elements that are given, None for all of them.
        """
        total = self._like.new_zeros(self._size)
        for block in self._blocks:
            here = total[block.start : block.start + block.nodes * block.width].view(block.nodes, block.width)
            for a in range(block.width):

                def fill(entry: _Entry, out: Tensor, a: int = a, width: int = block.width) -> None:
                    mine = _rows(local[entry.term], entry, width, a)
                    if factors is None:
                        out.copy_(mine)
                        return
                    theirs = factors[entry.term]
                    theirs = theirs[:, None] if theirs.ndim == 2 else _rows(theirs, entry, width, a)
                    _contract(mine, theirs, out)

                here[:, a] = self._summed(block, fill, local, felt)
        return total

    def blocks(self, jacobians: Sequence[Tensor], felt: Felt | None = None) -> Iterator[tuple[int, int, int, Tensor]]:
        """Lower triangles of the diagonal blocks of ``J^T J`` for element Jacobians ``(m, K, n)``, entry by entry.

        Where an element names a node twice, the mixed products are left out.

        Args:
            jacobians: Of every term.
            felt: See :meth:`vector`.

        Yields:
            First unknown of a block of variables, row, column, and the values (nodes,) of all its nodes.
        """
        for block in self._blocks:
            for a in range(block.width):
                for b in range(a + 1):

                    def fill(entry: _Entry, out: Tensor, a: int = a, b: int = b, width: int = block.width) -> None:
                        jacobian = jacobians[entry.term]
                        _contract(_rows(jacobian, entry, width, a), _rows(jacobian, entry, width, b), out)

                    yield block.start, a, b, self._summed(block, fill, jacobians, felt)

    def _summed(
        self, block: _Block, fill: Callable[[_Entry, Tensor], None], local: Sequence[Tensor], felt: Felt | None
    ) -> Tensor:
        values, start = self._like.new_empty(block.matrix.shape[1]), 0
        for entry in block.entries:
            count = local[entry.term].shape[-1]
            out = values[start : start + entry.rows * count].view(entry.rows, count)
            fill(entry, out)
            start += out.numel()
        result: Tensor = block.matrix @ values
        for entry in block.partial:
            out = self._like.new_empty(entry.rows, local[entry.term].shape[-1])
            fill(entry, out)
            chosen = None if felt is None else felt[entry.term]
            nodes = entry.nodes if chosen is None else entry.nodes[chosen]
            result.index_add_(0, nodes.T.reshape(-1), out.reshape(-1))
        return result


def _rows(local: Tensor, entry: _Entry, width: int, component: int) -> Tensor:
    """(..., rows, n) one component of the rows of an entry, of ``(..., K, n)``."""
    return local[..., entry.first + component : entry.first + entry.rows * width : width, :]


def _contract(one: Tensor, other: Tensor, out: Tensor) -> None:
    """(rows, n) sum over components of products of ``(m, rows, n)``."""
    torch.mul(one[0], other[0], out=out)
    for left, right in zip(one[1:], other[1:], strict=True):
        out.addcmul_(left, right)
