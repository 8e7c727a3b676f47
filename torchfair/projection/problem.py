"""Terms compiled for blocks of given sizes: everything about a problem that does not change with the state."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import torch
from torch import Tensor

from ..errors import ShapeError
from ..linear import BlockByBlock, BlockDense, LinearSolver, SparseDirect, choose_solver
from .checks import check_way, listed
from .differentiation import Way
from .layout import Layout, State
from .replicate import replicated
from .same_stencils import on_stencils_of
from .system import Structure
from .term import ElementTerm

_SMALL = 250  # unknowns of a member for which dense factors are the fastest

_Problem = TypeVar("_Problem", bound="Problem")


class Problem:
    """Terms compiled for blocks of given sizes.

    Args:
        blocks: Example blocks ``(n, d)``; only sizes, dtype and device matter.
        terms: What is to be small.
        fixed: Masks ``(n,)`` or ``(n, d)`` by block name, True where an unknown stays as it is.
        solver: Name of a linear solver, or an object with that protocol.
        derivatives: How all residuals are differentiated, see :class:`ElementTerm`; ``"closed form"`` those that have
            one. By default what each term says.

    Attributes:
        terms: All of them.
        layout: How blocks lie in the flat vector of unknowns.
        structure: Numbering, sparsity, index maps.
        solver: The linear solver.
    """

    def __init__(
        self,
        blocks: State,
        terms: Sequence[ElementTerm],
        *,
        fixed: Mapping[str, Tensor] | None = None,
        solver: str | LinearSolver = "auto",
        derivatives: Way | None = None,
    ) -> None:
        check_way("problem", derivatives)
        self._derivatives = derivatives
        self.terms = _differentiated(listed(terms), derivatives)
        self.layout = Layout.of(blocks)
        free = self.layout.free_mask({} if fixed is None else fixed, self.layout.device)
        with torch.no_grad():
            self.structure = Structure(self.layout, self.terms, free, self.layout.dtype)
        self._asked: str | LinearSolver = solver
        self._others: dict[object, Problem] = {}
        self.solver = choose_solver(solver, self.structure) if isinstance(solver, str) else solver

    def solved_by(self, solver: str | LinearSolver) -> Problem:
        """This problem with another linear solver; itself for ``"auto"`` and for the solver it was made with."""
        if solver in ("auto", self._asked):
            return self
        key = solver if isinstance(solver, str) else id(solver)
        if key not in self._others:
            other = copy.copy(self)
            other._asked, other._others = solver, {}
            other.solver = choose_solver(solver, self.structure) if isinstance(solver, str) else solver
            self._others[key] = other
        return self._others[key]

    def with_terms(self: _Problem, terms: Sequence[ElementTerm]) -> _Problem:
        """The same problem with other data, weights and losses of its terms; index maps and analysis are kept.

        Args:
            terms: On the same stencils as those before, in the same order.

        Raises:
            ShapeError: stencils differ, or other terms have elements and a weight.
        """
        result = copy.copy(self)
        result._others = {}
        result.terms = on_stencils_of(self.terms, _differentiated(listed(terms), self._derivatives))
        with torch.no_grad():
            result.structure = self.structure.with_terms(result.terms)
        if not result.structure.shares_pattern(self.structure):
            result.solver = copy.copy(self.solver)  # each keeps the analysis of its own pattern
        return result

    def with_fixed(self: _Problem, fixed: Mapping[str, Tensor]) -> _Problem:
        """The same problem with other unknowns that stay as they are; index maps and analysis are kept.

        Args:
            fixed: Masks ``(n,)`` or ``(n, d)`` by block name; unknowns that are not named may all move.

        Raises:
            ShapeError: a mask does not fit its block.
        """
        free = self.layout.free_mask(fixed, self.layout.device)
        if torch.equal(free, self.structure.free):
            return self
        result = copy.copy(self)
        result._others = {}
        with torch.no_grad():
            result.structure = self.structure.with_free(free)
        return result

    def batched(self, count: int) -> Problem:
        """The problems of ``count`` members with the same terms as one, see :class:`Layout`; kept for the next time.

        Small members have dense factors each, unless this problem has an iterative solver; larger ones have its sparse
        direct solver each, with one analysis for all, or its other solver for all together.
        """
        known = self._others.get(count)
        if known is None:
            known = self._others[count] = self._made_for(count)
        return known

    def _made_for(self, count: int) -> Problem:
        result = copy.copy(self)
        result._others = {}
        sizes = {name: (count * n, d) for name, (n, d) in self.layout.sizes.items()}
        result.layout = replace(self.layout, sizes=sizes, members=count)
        result.terms = [replicated(term, self.layout, count) for term in self.terms]
        parts = self.layout.unflatten(self.structure.free)
        free = torch.cat([part.repeat(count, 1).flatten() for part in parts.values()])
        result.structure = Structure(result.layout, result.terms, free, self.layout.dtype, self.structure)
        result.solver = _for_members(self.solver, result.layout.member_unknowns())
        return result

    def check_blocks(self, blocks: State) -> None:
        """Raises ShapeError unless blocks have sizes, dtype and device that the terms were compiled for."""
        given = Layout.of(blocks)
        if given != replace(self.layout, members=1):
            raise ShapeError("blocks", f"{self.layout} as compiled", str(given))

    def prepare(self) -> None:
        """Symbolic analysis; costs nothing where it is known."""
        self.solver.prepare(self.structure)


def _differentiated(terms: list[ElementTerm], way: Way | None) -> list[ElementTerm]:
    """Terms that are differentiated in a way, as far as they can be."""
    if way is None:
        return terms
    return [replace(term, derivatives=None if way == "closed form" else way) for term in terms]


def _for_members(solver: LinearSolver, unknowns: Tensor) -> LinearSolver:
    """The solver for a batch whose members have the unknowns (members, n)."""
    if unknowns.shape[1] <= _SMALL and not solver.inexact:
        return BlockDense(unknowns)
    if isinstance(solver, SparseDirect):
        return BlockByBlock(unknowns, solver)
    return copy.copy(solver)
