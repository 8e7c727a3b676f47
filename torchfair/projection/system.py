"""A compiled problem: numbering, sparsity, evaluation and linearisation."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from functools import cached_property

import torch
from torch import Tensor

from ..errors import ShapeError
from ..linear import LowerTriangle
from .affine import AffinePart
from .block_diagonal import BlockDiagonal
from .compiled import CompiledTerm
from .evaluation import Evaluation, Seen, seen
from .layout import Layout, State
from .linear_system import LinearSystem, ScaledResiduals
from .loss import is_one_sided
from .node_sums import Felt, NodeSums
from .normal_pattern import NormalPattern
from .portions import Arguments, are_many, portions
from .repeated_pattern import RepeatedPattern
from .replicate import first_members
from .row_pattern import RowPattern
from .term import ElementTerm


class Structure:
    """Everything about a problem that does not change with the state: numbering, sparsity, index maps.

    Attributes:
        terms: Those that have elements and a weight.
        compiled: Those of them that are not linear.
        affine: The linear ones, None if there are none.
        free: (N,) unknowns that may move.
        like: (N,) zeros, of the dtype and on the device of the blocks.
        partial: For each term of ``compiled``, whether linear systems hold those of its elements only that are felt
            (:class:`LinearSystem`): silent terms and inequalities, where there are many elements.

    Args:
        single: In a batch, the structure of one member.
    """

    def __init__(
        self,
        layout: Layout,
        terms: Sequence[ElementTerm],
        free: Tensor,
        dtype: torch.dtype,
        single: Structure | None = None,
    ) -> None:
        self.layout, self.free, self._single = layout, free, single
        self._linear: list[CompiledTerm] = []
        self.affine: AffinePart | None = None
        self._take([CompiledTerm(term, layout) for term in self._checked(terms)], dtype)
        self.like = torch.zeros(layout.num_unknowns, dtype=dtype, device=free.device)
        self._mask()

    def _mask(self) -> None:
        """Where the Jacobians of elements have columns of fixed unknowns."""
        every = bool(self.free.all())
        self._every, pairs = every, zip(self.compiled, self.partial, strict=True)
        self._free = [None if every or partial else self.free[c.unknowns] for c, partial in pairs]

    def _checked(self, terms: Sequence[ElementTerm]) -> list[ElementTerm]:
        for term in terms:
            term.check(self.layout)
        return [term for term in terms if term.num_elements and term.weight > 0.0]

    def _take(self, compiled: list[CompiledTerm], dtype: torch.dtype) -> None:
        self.terms = [c.term for c in compiled]
        self.compiled = [c for c in compiled if not c.term.linear]
        self.partial = [self._is_partial(c.term) for c in self.compiled]
        linear = [c for c in compiled if c.term.linear]
        if [id(c.term) for c in linear] == [id(c.term) for c in self._linear]:
            return  # the same system
        self._linear = linear
        self.affine = AffinePart(self._linear, self.layout, self.free, dtype) if self._linear else None

    def _is_partial(self, term: ElementTerm) -> bool:
        chosen = (term.silent or is_one_sided(term.loss)) and are_many(term.num_elements)
        return chosen and self.layout.members == 1 and self.free.is_cpu

    def with_terms(self, terms: Sequence[ElementTerm]) -> Structure:
        """The structure of terms on the same stencils with other data, weights and losses; index maps are kept.

        Raises:
            ShapeError: a term that has elements and a weight was not there before, is missing, or has another stencil.
        """
        chosen, known = self._checked(terms), {id(c.term): c for c in [*self.compiled, *self._linear]}
        if len(chosen) != len(self.terms):
            raise ShapeError("terms", f"{len(self.terms)} with elements and a weight", len(chosen))
        compiled = [known[id(before)].with_term(term) for before, term in zip(self.terms, chosen, strict=True)]
        result = self._without_constants()
        result._single = None
        result._take(compiled, self.like.dtype)
        if result.partial != self.partial:
            result.__dict__.pop("_node_sums", None)
            result.__dict__.pop("_row_patterns", None)
            result._mask()
        pattern = self.__dict__.get("normal_pattern")
        if isinstance(pattern, NormalPattern) and pattern.fits(result.affine):
            result.__dict__["normal_pattern"] = pattern.with_constant(result.affine)
        return result

    def with_free(self, free: Tensor) -> Structure:
        """The structure with other unknowns (N,) that may move; index maps are kept."""
        result = self._without_constants()
        result.free = free
        result.affine = None if self.affine is None else self.affine.with_free(free)
        result._mask()
        pattern = self.__dict__.get("normal_pattern")
        if pattern is not None:
            result.__dict__["normal_pattern"] = pattern.with_constant(result.affine)
        return result

    def _without_constants(self) -> Structure:
        """A copy without what holds numbers of the linear terms, or which unknowns are free."""
        result = copy.copy(self)
        for stale in ("normal_pattern", "block_diagonal", "_row_patterns"):
            result.__dict__.pop(stale, None)
        own = self.__dict__.get("_row_patterns", {}).get(False)  # of the terms that are not linear alone
        if own is not None:
            result.__dict__["_row_patterns"] = {False: own}
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
    def _node_sums(self) -> NodeSums:
        return NodeSums(self.layout, self.compiled, self.like, self.partial)

    def scatter(
        self, local: Sequence[Tensor], factors: Sequence[Tensor] | None = None, felt: Felt | None = None
    ) -> Tensor:
        """(N,) sum of local vectors ``(K, n)`` of the terms that are not linear.

        With ``factors`` of the terms, ``(m, n)`` or ``(m, K, n)``: of ``(m, K, n)`` times these, components added. With
        ``felt``, of the elements that are felt (:class:`LinearSystem`).
        """
        return self._node_sums.vector(local, factors, felt)

    def member_sums(self, local: Iterable[Tensor]) -> Tensor:
        """(members,) sums of local values ``(m, n)`` of the terms that are not linear."""
        members = self.layout.members
        parts = [part.view(part.shape[0], members, -1).sum((0, 2)) for part in local]
        return torch.stack([self.like.new_zeros(members), *parts]).sum(0)

    @cached_property
    def normal_pattern(self) -> NormalPattern | RepeatedPattern:
        """Sparsity of the normal matrix and the map into it."""
        single = None if self._single is None else self._single.normal_pattern
        if isinstance(single, NormalPattern):
            return RepeatedPattern(single, self.layout)
        return NormalPattern(self.layout, self.compiled, self.affine, self.like)

    @cached_property
    def block_diagonal(self) -> BlockDiagonal:
        """Diagonal blocks of the normal matrix and the map into them."""
        return BlockDiagonal(self.layout, self._node_sums, self.affine, self.like)

    def row_pattern(self, outputs: tuple[int, ...], *, whole: bool = True) -> RowPattern:
        """Sparsity of the Jacobian, for the numbers of components of the residuals.

        If whole, with the linear terms and with all elements; else without both and without terms that are partial.
        """
        known: dict[bool, tuple[tuple[int, ...], RowPattern]] = self.__dict__.setdefault("_row_patterns", {})
        if whole not in known or known[whole][0] != outputs:
            affine = self.affine if whole else None
            chosen = [c for c, partial in zip(self.compiled, self.partial, strict=True) if whole or not partial]
            known[whole] = outputs, RowPattern((c.unknowns for c in chosen), outputs, affine, self.like)
        return known[whole][1]

    def evaluate(self, state: State) -> Evaluation:
        """Residuals and merit of a state."""
        return self.summed(state, [seen(compiled.term, state) for compiled in self.compiled])

    def summed(self, state: State, terms: Sequence[Seen]) -> Evaluation:
        """The evaluation of a state of which all terms have been seen."""
        affine = None if self.affine is None else self.affine.residual(self.layout.flatten(state))
        return self._summed(state, terms, self.layout.members, affine)

    def evaluate_members(self, flat: Tensor, chosen: list[int]) -> Evaluation:
        """Residuals and merits of some members of a batch alone; those of linear terms for all of them.

        Args:
            flat: (N,) the state of all members.
            chosen: Numbers of members.
        """
        blocks = self.layout.unflatten(self.layout.chosen_members(flat, chosen), len(chosen))
        affine = None if self.affine is None else self.affine.residual(flat)
        terms = [first_members(c.term, c.term.num_elements // self.layout.members * len(chosen)) for c in self.compiled]
        return self._summed(blocks, [seen(term, blocks) for term in terms], len(chosen), affine, chosen)

    def _summed(
        self, state: State, terms: Sequence[Seen], count: int, affine: Tensor | None, chosen: list[int] | None = None
    ) -> Evaluation:
        parts = [self.like.new_zeros(count)]
        parts += [term.contributions.view(count, -1).sum(1).to(self.like) for term in terms]
        if self.affine is not None and affine is not None:
            own = 0.5 * self.affine.member_sums(affine.square(), self.layout.members)
            parts.append(own if chosen is None else own[chosen])
        merits = torch.stack(parts).sum(0)
        merits = torch.where(torch.isfinite(merits), merits, torch.inf)
        return Evaluation(state, merits, [term.arguments for term in terms], [term.values for term in terms], affine)

    def unknowns_of_infinite_elements(self, at: Evaluation) -> Tensor:
        """(N,) bool: unknowns of elements whose share of the merit is not finite."""
        bad = torch.zeros_like(self.free)
        for compiled, arguments, values in zip(self.compiled, at.arguments, at.values, strict=True):
            infinite = torch.nonzero(~torch.isfinite(compiled.term.contributions(arguments, values))).squeeze(1)
            bad[compiled.unknowns_of(infinite)] = True
        return bad

    def linearise(self, state: State | Evaluation) -> LinearSystem:
        """Residuals and Jacobians of all terms at a state, scaled by the square roots of their weights."""
        at = state if isinstance(state, Evaluation) else self.evaluate(state)
        roots = [c.term.roots(values) for c, values in zip(self.compiled, at.values, strict=True)]
        felt: list[Tensor | None] = []
        for compiled, partial, values in zip(self.compiled, self.partial, at.values, strict=True):
            silent = partial and compiled.term.silent
            felt.append(torch.nonzero((values != 0.0).any(1)).squeeze(1) if silent else None)

        def jacobians() -> list[Tensor]:
            return [self._jacobian(number, at, roots[number], felt[number]) for number in range(len(roots))]

        return LinearSystem(self, jacobians, ScaledResiduals(roots, at.values), roots, at.affine, felt)

    def _jacobian(self, number: int, at: Evaluation, root: Tensor, chosen: Tensor | None) -> Tensor:
        """(m, K, n) of a term, of all its elements or of some, times their roots."""
        if chosen is not None and not len(chosen):
            compiled, values = self.compiled[number], at.values[number]
            return values.new_zeros(values.shape[1], sum(compiled.widths), 0)
        return self._masked(number, _scaled(at.arguments[number], root, chosen), chosen)

    def _masked(self, number: int, jacobian: Tensor, chosen: Tensor | None) -> Tensor:
        """The Jacobians of a term with zero columns at fixed unknowns."""
        if self._every:
            return jacobian
        free = self._free[number]
        if free is None:
            unknowns = self.compiled[number].unknowns_of(slice(None) if chosen is None else chosen)
            return jacobian.mul_(self.free[unknowns])
        return jacobian.mul_(free)


def _scaled(arguments: Arguments, root: Tensor, chosen: Tensor | None) -> Tensor:
    """Jacobians of a term, of all its elements or of some, times their roots, as (m, K, n)."""
    if chosen is not None:
        root = root[chosen]
    result: Tensor | None = None
    for elements in portions(root.shape[0], root):
        part = arguments.part(elements if chosen is None else chosen[elements])
        jacobians, own = arguments.term.jacobians(part), root[elements]
        weighted = torch.bmm(own, jacobians.contiguous()) if own.ndim == 3 else jacobians
        local = weighted.permute(1, 2, 0)
        if result is None:
            result = jacobians.new_empty(*local.shape[:2], root.shape[0])
        out = result[..., elements]
        out.copy_(local) if own.ndim == 3 else torch.mul(local, own, out=out)
    assert result is not None
    return result
