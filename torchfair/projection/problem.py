"""Terms compiled for blocks of given sizes: everything about a problem that does not change with the state."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TypeVar

import torch
from torch import Tensor

from ..errors import ShapeError
from ..linear import LinearSolver, choose_solver
from .checks import listed
from .layout import Layout, State
from .system import Structure
from .term import ElementTerm

_Problem = TypeVar("_Problem", bound="Problem")


class Problem:
    """Terms compiled for blocks of given sizes.

    Args:
        blocks: Example blocks ``(n, d)``; only sizes, dtype and device matter.
        terms: What is to be small.
        fixed: Masks ``(n,)`` or ``(n, d)`` by block name, True where an unknown stays as it is.
        solver: Name of a linear solver, or an object with that protocol.

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
    ) -> None:
        self.terms = listed(terms)
        self.layout = Layout.of(blocks)
        free = self.layout.free_mask({} if fixed is None else fixed, self.layout.device)
        with torch.no_grad():
            self.structure = Structure(self.layout, self.terms, free, self.layout.dtype)
        self.solver = choose_solver(solver, self.structure) if isinstance(solver, str) else solver

    def with_terms(self: _Problem, terms: Sequence[ElementTerm]) -> _Problem:
        """The same problem with other data, weights and losses of its terms; index maps and analysis are kept.

        Args:
            terms: On the same stencils as those before, in the same order.

        Raises:
            ShapeError: stencils differ, or other terms have elements and a weight.
        """
        result = copy.copy(self)
        result.terms = listed(terms)
        with torch.no_grad():
            result.structure = self.structure.with_terms(result.terms)
        if not result.structure.shares_pattern(self.structure):
            result.solver = copy.copy(self.solver)  # each keeps the analysis of its own pattern
        return result

    def check_blocks(self, blocks: State) -> None:
        """Raises ShapeError unless blocks have sizes, dtype and device that the terms were compiled for."""
        given = Layout.of(blocks)
        if given != self.layout:
            raise ShapeError("blocks", f"{self.layout} as compiled", str(given))

    def prepare(self) -> None:
        """Symbolic analysis; costs nothing where it is known."""
        self.solver.prepare(self.structure)
