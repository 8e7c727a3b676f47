"""The linearised problem: element Jacobians, and what linear solvers need of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor

from .layout import Layout, State
from .normal_pattern import NormalPattern
from .sparse import csr_matrix, scatter_matrix
from .term import ElementTerm


class CompiledTerm:
    """A term with its unknowns numbered in the flat vector.

    Attributes:
        unknowns: (K, n) flat number of each unknown of each element.
        nodes: (k, n) node number of each row of the stencil, all blocks together.
        widths: number of unknowns of each of the k rows.
    """

    def __init__(self, term: ElementTerm, layout: Layout) -> None:
        self.term = term
        unknowns, nodes, self.widths = [], [], []
        for name, index in term.stencil:
            width = layout.sizes[name][1]
            components = torch.arange(width, device=index.device)
            flat = layout.offset(name) + index[:, :, None] * width + components
            unknowns.append(flat.flatten(1))
            nodes.append(layout.node_offset(name) + index)
            self.widths += [width] * index.shape[1]
        self.unknowns = torch.cat(unknowns, dim=1).T.contiguous()
        self.nodes = torch.cat(nodes, dim=1).T.contiguous()


class Structure:
    """Everything about a problem that does not change with the state: numbering, sparsity, index maps."""

    def __init__(self, layout: Layout, terms: Sequence[ElementTerm], free: Tensor, dtype: torch.dtype) -> None:
        for term in terms:
            term.check(layout)
        self.layout = layout
        self.compiled = [CompiledTerm(term, layout) for term in terms if term.num_elements and term.weight > 0]
        self.free = free
        self.any_fixed = not bool(free.all())
        self.dtype = dtype
        self._linear: dict[int, tuple[Tensor, Tensor]] = {}

    @property
    def num_unknowns(self) -> int:
        """Length of the flat vector."""
        return self.free.shape[0]

    @cached_property
    def unknown_scatter(self) -> Tensor:
        """Sums local vectors ``(K, n)`` of all terms into the flat vector."""
        index = torch.cat([c.unknowns.reshape(-1) for c in self.compiled])
        return scatter_matrix(index, self.num_unknowns, self.dtype)

    @cached_property
    def node_scatter(self) -> Tensor:
        """Sums values at stencil rows ``(k, n)`` of all terms into nodes."""
        index = torch.cat([c.nodes.reshape(-1) for c in self.compiled])
        return scatter_matrix(index, self.layout.num_nodes, self.dtype)

    @cached_property
    def normal_pattern(self) -> NormalPattern:
        """Sparsity of the normal matrix and the map into it."""
        return NormalPattern(
            self.layout,
            [(c.nodes, c.widths, c.unknowns, c.term.linear) for c in self.compiled],
            self.dtype,
        )

    def jacobian_rows(self, shapes: Sequence[torch.Size]) -> tuple[Tensor, Tensor]:
        """Offsets and columns of the stored Jacobian for element Jacobians of shapes ``(m, K, n)``."""
        key = tuple(tuple(shape) for shape in shapes)
        if getattr(self, "_rows_key", None) != key:
            counts = [torch.full((m * n,), k, device=self.free.device) for m, k, n in key]
            offsets = torch.zeros(sum(c.shape[0] for c in counts) + 1, dtype=torch.int64, device=self.free.device)
            torch.cumsum(torch.cat(counts), 0, out=offsets[1:])
            columns = [
                c.unknowns.T.expand(m, -1, -1).reshape(-1) for c, (m, _, _) in zip(self.compiled, key, strict=True)
            ]
            self._rows = (offsets.to(torch.int32), torch.cat(columns).to(torch.int32))
            self._rows_key = key
            self._transpose: tuple[Tensor, Tensor, Tensor] | None = None
        return self._rows

    def jacobian_transpose(self, shapes: Sequence[torch.Size]) -> tuple[Tensor, Tensor, Tensor]:
        """Offsets, columns and value permutation of the transposed Jacobian."""
        offsets, columns = self.jacobian_rows(shapes)
        if self._transpose is None:
            order = torch.argsort(columns, stable=True)
            rows = torch.repeat_interleave(offsets.diff().to(torch.int64))
            counts = torch.bincount(columns, minlength=self.num_unknowns)
            starts = torch.zeros(self.num_unknowns + 1, dtype=torch.int64, device=columns.device)
            torch.cumsum(counts, 0, out=starts[1:])
            self._transpose = (starts.to(torch.int32), rows[order].to(torch.int32), order)
        return self._transpose

    def linearise(self, state: State) -> LinearSystem:
        """Residuals and Jacobians of all terms at ``state``, scaled by the square roots of their weights."""
        jacobians, residuals = [], []
        for number, compiled in enumerate(self.compiled):
            term = compiled.term
            arguments = term.arguments(state)
            if term.linear and number in self._linear:
                jacobian, root = self._linear[number]
                residual = term.values(arguments).T * root
            else:
                plain, local = term.derivatives(arguments)
                root = term.scaled_weights(plain.square().sum(1)).sqrt()
                residual = (plain * root[:, None]).T
                jacobian = (local * root[:, None, None]).permute(1, 2, 0).contiguous()
                if self.any_fixed:
                    jacobian = jacobian * self.free[compiled.unknowns]
                if term.linear:
                    self._linear[number] = (jacobian, root)
            jacobians.append(jacobian)
            residuals.append(residual)
        return LinearSystem(self, jacobians, residuals)


class LinearSystem:
    """``J`` and ``r`` of the quadratic model ``|r + J d|^2 / 2`` at one state.

    Fixed unknowns have zero columns in ``J``; solvers see a unit diagonal there through :attr:`damping_floor`.

    Attributes:
        jacobians: per term ``(m, K, n)``, unknowns as in ``CompiledTerm.unknowns``.
        residuals: per term ``(m, n)``.
    """

    def __init__(self, structure: Structure, jacobians: list[Tensor], residuals: list[Tensor]) -> None:
        self.structure = structure
        self.jacobians = jacobians
        self.residuals = residuals

    @cached_property
    def gradient(self) -> Tensor:
        """``J^T r``, the gradient of the merit."""
        local = [
            torch.einsum("mkn,mn->kn", j, r).reshape(-1) for j, r in zip(self.jacobians, self.residuals, strict=True)
        ]
        return self.structure.unknown_scatter @ torch.cat(local)

    @cached_property
    def diagonal(self) -> Tensor:
        """Diagonal of ``J^T J``; zero at fixed unknowns and at unknowns that no term feels.

        Used for scaling only: where an element names a node twice, the mixed products are left out, here
        and in :attr:`diagonal_blocks`.
        """
        local = [j.square().sum(0).reshape(-1) for j in self.jacobians]
        return self.structure.unknown_scatter @ torch.cat(local)

    @cached_property
    def diagonal_blocks(self) -> dict[str, Tensor]:
        """Diagonal blocks ``(n, d, d)`` of ``J^T J``, by block of variables."""
        layout = self.structure.layout
        widths = {width for _, width in layout.sizes.values()}
        sums: dict[int, Tensor] = {}
        for width in widths:
            parts = [
                self._local_blocks(c, j, width) for c, j in zip(self.structure.compiled, self.jacobians, strict=True)
            ]
            sums[width] = (self.structure.node_scatter @ torch.cat(parts)).view(-1, width, width)
        blocks = {}
        for name, (count, width) in layout.sizes.items():
            first = layout.node_offset(name)
            blocks[name] = sums[width][first : first + count]
        return blocks

    @staticmethod
    def _local_blocks(compiled: CompiledTerm, jacobian: Tensor, width: int) -> Tensor:
        parts, first = [], 0
        for own in compiled.widths:
            piece = jacobian[:, first : first + own]
            if own == width:
                parts.append(torch.einsum("min,mjn->nij", piece, piece).flatten(1))
            else:
                parts.append(jacobian.new_zeros(jacobian.shape[2], width * width))
            first += own
        return torch.cat(parts)

    @cached_property
    def jacobian(self) -> Tensor:
        """``J`` as a CSR matrix."""
        offsets, columns = self.structure.jacobian_rows([j.shape for j in self.jacobians])
        return csr_matrix(offsets, columns, self._values, (offsets.shape[0] - 1, self.structure.num_unknowns))

    @cached_property
    def jacobian_transpose(self) -> Tensor:
        """``J^T`` as a CSR matrix."""
        offsets, columns, order = self.structure.jacobian_transpose([j.shape for j in self.jacobians])
        rows = self.structure.jacobian_rows([j.shape for j in self.jacobians])[0].shape[0] - 1
        return csr_matrix(offsets, columns, self._values[order], (self.structure.num_unknowns, rows))

    @cached_property
    def _values(self) -> Tensor:
        return torch.cat([j.permute(0, 2, 1).reshape(-1) for j in self.jacobians])

    @cached_property
    def residual_vector(self) -> Tensor:
        """``r`` in the row order of :attr:`jacobian`."""
        return torch.cat([r.reshape(-1) for r in self.residuals])

    @cached_property
    def normal_values(self) -> Tensor:
        """Values of the lower triangle of ``J^T J`` in the order of the normal pattern."""
        return self.structure.normal_pattern.assemble(self.jacobians)
