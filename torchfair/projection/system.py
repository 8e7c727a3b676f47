"""The linearised problem: element Jacobians, and what linear solvers need of them."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor

from ..errors import ShapeError
from ..linear import LowerTriangle
from ..linear.block_inverse import block_inverse
from ..linear.sparse import scatter_matrix
from .affine import AffinePart
from .block_diagonal import BlockDiagonal
from .compiled import CompiledTerm
from .layout import Layout, State
from .loss import apply_root
from .normal_pattern import NormalPattern
from .row_pattern import RowPattern
from .term import ElementTerm


class Evaluation(NamedTuple):
    """A state with its residuals.

    Attributes:
        state: The blocks.
        merits: (members,) sums of all terms, one for each member of a batch; infinity where a residual is not finite,
            so that such a state is never accepted.
        arguments, values: Of each term of ``Structure.compiled``, unscaled.
        affine: Scaled residuals of the linear terms.
    """

    state: State
    merits: Tensor
    arguments: list[tuple[Tensor, ...]]
    values: list[Tensor]
    affine: Tensor | None


class Structure:
    """Everything about a problem that does not change with the state: numbering, sparsity, index maps.

    Attributes:
        terms: Those that have elements and a weight.
        compiled: Those of them that are not linear.
        affine: The linear ones, None if there are none.
        free: (N,) unknowns that may move.
    """

    def __init__(self, layout: Layout, terms: Sequence[ElementTerm], free: Tensor, dtype: torch.dtype) -> None:
        self.layout, self.free = layout, free
        self._take([CompiledTerm(term, layout) for term in self._checked(terms)], dtype)
        self._like = torch.zeros(layout.num_unknowns, dtype=dtype, device=free.device)
        self._mask()

    def _mask(self) -> None:
        """Where the Jacobians of elements have columns of fixed unknowns."""
        self._free = [None if bool(self.free.all()) else self.free[c.unknowns] for c in self.compiled]

    def _checked(self, terms: Sequence[ElementTerm]) -> list[ElementTerm]:
        for term in terms:
            term.check(self.layout)
        return [term for term in terms if term.num_elements and term.weight > 0.0]

    def _take(self, compiled: list[CompiledTerm], dtype: torch.dtype) -> None:
        self.terms = [c.term for c in compiled]
        self.compiled = [c for c in compiled if not c.term.linear]
        self._linear = [c for c in compiled if c.term.linear]
        self.affine = AffinePart(self._linear, self.layout, self.free, dtype) if self._linear else None

    def with_terms(self, terms: Sequence[ElementTerm]) -> Structure:
        """The structure of terms on the same stencils with other data, weights and losses; index maps are kept.

        Raises:
            ShapeError: a term that has elements and a weight was not there before, is missing, or has another stencil.
        """
        chosen, known = self._checked(terms), {id(c.term): c for c in [*self.compiled, *self._linear]}
        if len(chosen) != len(self.terms):
            raise ShapeError("terms", f"{len(self.terms)} with elements and a weight", len(chosen))
        compiled = [known[id(before)].with_term(term) for before, term in zip(self.terms, chosen, strict=True)]
        result = copy.copy(self)
        for stale in ("normal_pattern", "block_diagonal", "_outputs"):
            result.__dict__.pop(stale, None)
        result._take(compiled, self._like.dtype)
        pattern = self.__dict__.get("normal_pattern")
        if pattern is not None and pattern.fits(result.affine):
            result.__dict__["normal_pattern"] = pattern.with_constant(result.affine)
        return result

    def with_free(self, free: Tensor) -> Structure:
        """The structure with other unknowns (N,) that may move; index maps are kept."""
        result = copy.copy(self)
        result.free = free
        for stale in ("normal_pattern", "block_diagonal", "_outputs"):
            result.__dict__.pop(stale, None)
        result.affine = None if self.affine is None else self.affine.with_free(free)
        result._mask()
        pattern = self.__dict__.get("normal_pattern")
        if pattern is not None:
            result.__dict__["normal_pattern"] = pattern.with_constant(result.affine)
        return result

    def shares_pattern(self, other: Structure) -> bool:
        """Whether the normal matrices of both are filled in the same places; False unless known."""
        mine, theirs = (structure.__dict__.get("normal_pattern") for structure in (self, other))
        return mine is not None and theirs is not None and mine.lower is theirs.lower

    @property
    def num_unknowns(self) -> int:
        """Length of the flat vector."""
        return self.free.shape[0]

    @property
    def device(self) -> torch.device:
        """Of the unknowns."""
        return self.free.device

    @property
    def lower(self) -> LowerTriangle:
        """Places of the lower triangle of the normal matrix."""
        return self.normal_pattern.lower

    @cached_property
    def _scatter(self) -> Tensor:
        """Sums local vectors ``(K, n)`` of all terms into the flat vector."""
        index = torch.cat([c.unknowns.reshape(-1) for c in self.compiled])
        return scatter_matrix(index, self.num_unknowns, self._like.dtype)

    def scatter(self, local: Sequence[Tensor]) -> Tensor:
        """(N,) sum of local vectors ``(K, n)`` of the terms that are not linear."""
        if not local:
            return self._like.clone()
        total: Tensor = self._scatter @ torch.cat([part.reshape(-1) for part in local])
        return total

    def member_sums(self, local: Sequence[Tensor]) -> Tensor:
        """(members,) sums of local values ``(m, n)`` of the terms that are not linear."""
        members = self.layout.members
        parts = [part.view(part.shape[0], members, -1).sum((0, 2)) for part in local]
        return torch.stack([self._like.new_zeros(members), *parts]).sum(0)

    @cached_property
    def normal_pattern(self) -> NormalPattern:
        """Sparsity of the normal matrix and the map into it."""
        return NormalPattern(self.layout, self.compiled, self.affine, self._like)

    @cached_property
    def block_diagonal(self) -> BlockDiagonal:
        """Diagonal blocks of the normal matrix and the map into them."""
        return BlockDiagonal(self.layout, self.compiled, self.affine, self._like)

    def row_pattern(self, outputs: tuple[int, ...]) -> RowPattern:
        """Sparsity of the whole Jacobian, for the numbers of components of the residuals."""
        if getattr(self, "_outputs", None) != outputs:
            self._outputs = outputs
            self._row_pattern = RowPattern(self.compiled, outputs, self.affine, self._like)
        return self._row_pattern

    def evaluate(self, state: State) -> Evaluation:
        """Residuals and merit of a state."""
        arguments, values, parts = [], [], [self._like.new_zeros(self.layout.members)]
        for term in (compiled.term for compiled in self.compiled):
            arguments.append(term.arguments(state))
            values.append(term.values(arguments[-1]))
            contributions = term.contributions(arguments[-1], values[-1])
            parts.append(contributions.view(self.layout.members, -1).sum(1).to(self._like))
        affine = None
        if self.affine is not None:
            affine = self.affine.residual(self.layout.flatten(state))
            parts.append(0.5 * self.affine.member_sums(affine.square(), self.layout.members))
        merits = torch.stack(parts).sum(0)
        merits = torch.where(torch.isfinite(merits), merits, torch.inf)
        return Evaluation(state, merits, arguments, values, affine)

    def unknowns_of_infinite_elements(self, at: Evaluation) -> Tensor:
        """(N,) bool: unknowns of elements whose share of the merit is not finite."""
        bad = []
        for compiled, arguments, values in zip(self.compiled, at.arguments, at.values, strict=True):
            infinite = ~torch.isfinite(compiled.term.contributions(arguments, values))
            bad.append(infinite.to(self._like).expand_as(compiled.unknowns))
        return self.scatter(bad) > 0.0

    def linearise(self, state: State | Evaluation) -> LinearSystem:
        """Residuals and Jacobians of all terms at a state, scaled by the square roots of their weights."""
        at = state if isinstance(state, Evaluation) else self.evaluate(state)
        jacobians, residuals, roots = [], [], []
        for compiled, free, arguments, values in zip(self.compiled, self._free, at.arguments, at.values, strict=True):
            roots.append(compiled.term.roots(values))
            residuals.append(apply_root(roots[-1], values).T)
            jacobian = _scaled(compiled.term.jacobians(arguments), roots[-1])
            jacobians.append(jacobian if free is None else jacobian.mul_(free))
        return LinearSystem(self, jacobians, residuals, roots, at.affine)


class LinearSystem:
    """``J`` and ``r`` of the quadratic model ``|r + J d|^2 / 2`` at one state.

    Fixed unknowns have zero columns in ``J``: without damping the normal matrix is singular there.

    Attributes:
        jacobians: for each term of ``Structure.compiled`` ``(m, K, n)``, unknowns as in ``CompiledTerm``.
        residuals: likewise ``(m, n)``.
        roots: square roots of the weights that both are scaled by, see ``ElementTerm.roots``.
        affine_residual: of the linear terms.
    """

    def __init__(
        self,
        structure: Structure,
        jacobians: list[Tensor],
        residuals: list[Tensor],
        roots: list[Tensor],
        affine_residual: Tensor | None,
    ) -> None:
        self.structure = structure
        self.jacobians = jacobians
        self.residuals = residuals
        self.roots = roots
        self.affine_residual = affine_residual

    @cached_property
    def gradient(self) -> Tensor:
        """``J^T r``, the gradient of the merit."""
        return self._pulled_back(self.residuals, self.affine_residual)

    def gradient_with(self, other: Evaluation) -> Tensor:
        """``J^T r`` with the residuals of another state, in the weights of this one."""
        residuals = [apply_root(root, values).T for root, values in zip(self.roots, other.values, strict=True)]
        return self._pulled_back(residuals, other.affine)

    def _pulled_back(self, residuals: Sequence[Tensor], affine: Tensor | None) -> Tensor:
        total = self.structure.scatter([_contract(j, r) for j, r in zip(self.jacobians, residuals, strict=True)])
        if self.structure.affine is not None and affine is not None:
            total += self.structure.affine.gradient(affine)
        return total

    def changes(self, step: Tensor) -> tuple[list[Tensor], Tensor | None]:
        """By how much a step (N,) changes the residuals of the model: of each term (m, n), and of the linear terms."""
        terms = [
            torch.einsum("mkn,kn->mn", jacobian, step[compiled.unknowns])
            for compiled, jacobian in zip(self.structure.compiled, self.jacobians, strict=True)
        ]
        return terms, None if self.structure.affine is None else self.structure.affine.change(step)

    def predicted_fall(self, step: Tensor) -> Tensor:
        """(members,) by how much the merit of the linearised residuals falls with a step (N,)."""
        structure = self.structure
        members = structure.layout.members
        total = -structure.layout.member_sums(step * self.gradient)
        terms, affine = self.changes(step)
        total -= 0.5 * structure.member_sums([change.square() for change in terms])
        if affine is not None and structure.affine is not None:
            total -= 0.5 * structure.affine.member_sums(affine.square(), members)
        return total

    @cached_property
    def diagonal(self) -> Tensor:
        """Diagonal of ``J^T J``; zero at fixed unknowns and at unknowns that no term feels.

        Used for scaling only: where an element names a node twice, the mixed products are left out, here
        and in :attr:`diagonal_blocks`.
        """
        total = self.structure.scatter([_contract(j, j) for j in self.jacobians])
        return total if self.structure.affine is None else total + self.structure.affine.diagonal

    @cached_property
    def diagonal_blocks(self) -> dict[str, Tensor]:
        """Diagonal blocks ``(n, d, d)`` of ``J^T J``, by block of variables."""
        diagonal = self.structure.block_diagonal
        return diagonal.split(diagonal.values(self.jacobians))

    @cached_property
    def _matrices(self) -> tuple[Tensor, Tensor]:
        return self.structure.row_pattern(tuple(j.shape[0] for j in self.jacobians)).matrices(self.jacobians)

    @property
    def jacobian(self) -> Tensor:
        """``J`` as a CSR matrix."""
        return self._matrices[0]

    @property
    def jacobian_transpose(self) -> Tensor:
        """``J^T`` as a CSR matrix."""
        return self._matrices[1]

    @cached_property
    def residual_vector(self) -> Tensor:
        """``r`` in the row order of :attr:`jacobian`."""
        parts = [r.reshape(-1) for r in self.residuals]
        return torch.cat(parts if self.affine_residual is None else [*parts, self.affine_residual])

    @property
    def pattern(self) -> Structure:
        """Where the normal matrix has entries."""
        return self.structure

    @property
    def root(self) -> Tensor:
        """``J``, the root of the normal matrix."""
        return self.jacobian

    def product(self, vectors: Tensor) -> Tensor:
        """``J^T J`` times vectors (N,) or (N, k)."""
        result: Tensor = self.jacobian_transpose @ (self.jacobian @ vectors)
        return result

    def preconditioner(self, damping: Tensor) -> Tensor:
        """Inverse of the damped diagonal blocks, as a CSR matrix."""
        parts = self.structure.layout.unflatten(damping)
        inverses = [
            block_inverse(block + torch.diag_embed(parts[name])) for name, block in self.diagonal_blocks.items()
        ]
        return self.structure.block_diagonal.matrix(torch.cat([inverse.reshape(-1) for inverse in inverses]))

    @cached_property
    def lower_values(self) -> Tensor:
        """Values of the lower triangle of ``J^T J`` in the order of the normal pattern."""
        return self.structure.normal_pattern.assemble(self.jacobians)


def _scaled(jacobians: Tensor, root: Tensor) -> Tensor:
    """Jacobians (n, m, K) times their roots, as (m, K, n)."""
    if root.ndim == 3:
        return torch.bmm(root, jacobians.contiguous()).permute(1, 2, 0).contiguous()
    local = jacobians.permute(1, 2, 0)
    return torch.mul(local, root, out=torch.empty_like(local, memory_format=torch.contiguous_format))


def _contract(jacobian: Tensor, other: Tensor) -> Tensor:
    """(K, n) sum over components of ``jacobian`` (m, K, n) times ``other`` (m, n) or (m, K, n)."""
    total = jacobian[0] * other[0]
    for row, factor in zip(jacobian[1:], other[1:], strict=True):
        total.addcmul_(row, factor)
    return total
