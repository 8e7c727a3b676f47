"""Residuals and Jacobians at one state, and what linear solvers need of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ..linear.block_inverse import block_inverse
from .loss import apply_root
from .node_sums import Felt
from .portions import are_many, portions
from .row_pattern import RowPattern

if TYPE_CHECKING:
    from .evaluation import Evaluation
    from .system import Structure


class ScaledResiduals(Sequence[Tensor]):
    """Residuals (m, n) of terms times their roots; made whenever they are asked for, of the values that a state has.

    Args:
        roots: See :class:`LinearSystem`.
        values: (n, m) of each term, unscaled.
    """

    def __init__(self, roots: Sequence[Tensor], values: Sequence[Tensor]) -> None:
        self._roots, self._values = roots, values

    def __len__(self) -> int:
        return len(self._values)

    def __getitem__(self, number):  # type: ignore[no-untyped-def]
        return apply_root(self._roots[number], self._values[number]).T


class LinearSystem:
    """``J`` and ``r`` of the quadratic model ``|r + J d|^2 / 2`` at one state.

    Fixed unknowns have zero columns in ``J``: without damping the normal matrix is singular there.

    Attributes:
        jacobians: for each term of ``Structure.compiled`` ``(m, K, n)``, unknowns as in ``CompiledTerm``; of the n
            elements that are felt.
        residuals: likewise ``(m, n)``, of all elements.
        roots: square roots of the weights that both are scaled by, see ``ElementTerm.roots``; of all elements.
        affine_residual: of the linear terms.
        felt: for each term the numbers (n,) of those of its elements whose Jacobians are not zero; None for all
            elements, which is so where ``Structure.partial`` is not.
    """

    def __init__(
        self,
        structure: Structure,
        jacobians: list[Tensor] | Callable[[], list[Tensor]],
        residuals: Sequence[Tensor],
        roots: list[Tensor],
        affine_residual: Tensor | None,
        felt: Felt | None = None,
    ) -> None:
        self.structure = structure
        self._make = jacobians if callable(jacobians) else partial(list, jacobians)
        self.residuals = residuals
        self.roots = roots
        self.affine_residual = affine_residual
        self.felt: Felt = felt or [None] * len(residuals)

    @cached_property
    def jacobians(self) -> list[Tensor]:
        """See above; made where they are first asked for."""
        return self._make()

    def of_felt(self, parts: Iterable[Tensor]) -> list[Tensor]:
        """Of values (m, n) of all elements of the terms those of the elements that are felt."""
        return [p if chosen is None else p[:, chosen] for p, chosen in zip(parts, self.felt, strict=True)]

    def elements(self, number: int) -> slice | Tensor:
        """The elements of a term that are felt: all, or their numbers."""
        chosen = self.felt[number]
        return slice(None) if chosen is None else chosen

    @property
    def whole_jacobians(self) -> list[Tensor]:
        """``(m, K, n)`` of all elements, with zeros where they are not felt."""
        return [self._of_all(number, jacobian) for number, jacobian in enumerate(self.jacobians)]

    def _of_all(self, number: int, part: Tensor) -> Tensor:
        chosen = self.felt[number]
        if chosen is None:
            return part
        whole = part.new_zeros(*part.shape[:-1], self.structure.compiled[number].term.num_elements)
        whole[..., chosen] = part
        return whole

    def without(self, members: Collection[int]) -> LinearSystem:
        """The same without what some members of a batch have that is not linear: zeros there."""
        gone = torch.zeros(self.structure.layout.members, dtype=torch.bool)
        gone[list(members)] = True
        gone = gone.to(self.structure.device)

        def kept(part: Tensor) -> Tensor:
            return torch.where(gone.repeat_interleave(part.shape[-1] // gone.shape[0]), 0.0, part)

        roots = [kept(root.movedim(0, -1)).movedim(-1, 0) for root in self.roots]
        return LinearSystem(
            self.structure,
            [kept(jacobian) for jacobian in self.jacobians],
            [kept(residual) for residual in self.residuals],
            roots,
            self.affine_residual,
            self.felt,
        )

    @cached_property
    def gradient(self) -> Tensor:
        """``J^T r``, the gradient of the merit."""
        return self._pulled_back(self.residuals, self.affine_residual)

    def gradient_with(self, other: Evaluation) -> Tensor:
        """``J^T r`` with the residuals of another state, in the weights of this one."""
        residuals = [apply_root(root, values).T for root, values in zip(self.roots, other.values, strict=True)]
        return self._pulled_back(residuals, other.affine)

    def _pulled_back(self, residuals: Sequence[Tensor], affine: Tensor | None) -> Tensor:
        total = self.structure.scatter(self.jacobians, self.of_felt(residuals), self.felt)
        if self.structure.affine is not None and affine is not None:
            total += self.structure.affine.gradient(affine)
        return total

    def changes(self, step: Tensor) -> tuple[list[Tensor], Tensor | None]:
        """By how much a step (N,) changes the residuals of the model: of each term (m, n), and of the linear terms."""
        terms = [self._change(number, step) for number in range(len(self.jacobians))]
        return terms, None if self.structure.affine is None else self.structure.affine.change(step)

    def rises(self, number: int, step: Tensor) -> Tensor:
        """(n,) by how much a step (N,) raises the shares of the elements of a term in the merit of the model."""
        change = self._change(number, step)
        return (change * (self.residuals[number] + 0.5 * change)).sum(0)

    def _change(self, number: int, step: Tensor) -> Tensor:
        jacobian = self.jacobians[number]
        ranges = self.felt_unknowns(number)
        parts = [torch.einsum("mkn,kn->mn", jacobian[..., some], step[unknowns]) for some, unknowns in ranges]
        return self._of_all(number, parts[0] if len(parts) == 1 else torch.cat(parts, 1))

    def felt_unknowns(self, number: int) -> Iterator[tuple[slice, Tensor]]:
        """Ranges of the elements of a term that are felt, and the flat numbers (K, n) of the unknowns of each range."""
        chosen, jacobian = self.felt[number], self.jacobians[number]
        for some in portions(jacobian.shape[2], jacobian):
            yield some, self.structure.compiled[number].unknowns_of(some if chosen is None else chosen[some])

    def predicted_fall(self, step: Tensor) -> Tensor:
        """(members,) by how much the merit of the linearised residuals falls with a step (N,)."""
        structure = self.structure
        members = structure.layout.members
        total = -structure.layout.member_sums(step * self.gradient)
        total -= 0.5 * structure.member_sums(self._change(n, step).square() for n in range(len(self.jacobians)))
        if structure.affine is not None:
            total -= 0.5 * structure.affine.member_sums(structure.affine.change(step).square(), members)
        return total

    @cached_property
    def diagonal(self) -> Tensor:
        """Diagonal of ``J^T J``; zero at fixed unknowns and at unknowns that no term feels.

        Used for scaling only: where an element names a node twice, the mixed products are left out, here
        and in :attr:`diagonal_blocks`.
        """
        total = self.structure.scatter(self.jacobians, self.jacobians, self.felt)
        return total if self.structure.affine is None else total + self.structure.affine.diagonal

    @cached_property
    def diagonal_blocks(self) -> dict[str, Tensor]:
        """Diagonal blocks ``(n, d, d)`` of ``J^T J``, by block of variables."""
        diagonal = self.structure.block_diagonal
        return diagonal.split(diagonal.values(self.jacobians, self.felt))

    @cached_property
    def _matrices(self) -> tuple[Tensor, Tensor]:
        return self.structure.row_pattern(tuple(j.shape[0] for j in self.jacobians)).matrices(self.whole_jacobians)

    @cached_property
    def _term_matrices(self) -> list[tuple[Tensor, Tensor]]:
        """The Jacobian of the terms that are not linear and its transpose: of those with all elements, of others."""
        partial = self.structure.partial
        whole = [j for j, some in zip(self.jacobians, partial, strict=True) if not some]
        found = [self.structure.row_pattern(tuple(j.shape[0] for j in whole), whole=False).matrices(whole)]
        chosen = [number for number, some in enumerate(partial) if some and self.jacobians[number].shape[2]]
        if chosen:
            unknowns = (self.structure.compiled[number].unknowns_of(self.elements(number)) for number in chosen)
            jacobians = [self.jacobians[number] for number in chosen]
            outputs = [jacobian.shape[0] for jacobian in jacobians]
            found.append(RowPattern(unknowns, outputs, None, self.structure.like).matrices(jacobians))
        return found

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

    def forget(self) -> None:
        """Forgets the matrices, see :meth:`release`, and the Jacobians of large problems."""
        self.release()
        if are_many(self.structure.num_unknowns):
            self.__dict__.pop("jacobians", None)

    def spare(self) -> None:
        """Forgets the matrices of large problems, see :meth:`release`."""
        if are_many(self.structure.num_unknowns):
            self.release()

    def release(self) -> None:
        """Forgets the matrices, which are made anew where they are asked for."""
        for name in ("_matrices", "_term_matrices", "diagonal_blocks", "lower_values"):
            self.__dict__.pop(name, None)

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
        (rows, turned), *others = self._term_matrices
        result: Tensor = turned @ (rows @ vectors)
        for rows, turned in others:
            result += turned @ (rows @ vectors)
        return result if self.structure.affine is None else result.add_(self.structure.affine.product(vectors))

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
        return self.structure.normal_pattern.assemble(self.whole_jacobians)
