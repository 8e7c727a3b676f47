"""Terms compiled for blocks of given sizes: everything about a problem that does not change with the state."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TypeVar

from torch import Tensor

from ..errors import ShapeError
from ..linear import LinearSolver, choose_solver
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
        if not blocks or not terms:
            raise ShapeError("guided projection", "at least one block and one term", f"{len(blocks)} and {len(terms)}")
        first = next(iter(blocks.values()))
        for name, block in blocks.items():
            if block.dtype != first.dtype or block.device != first.device:
                raise ShapeError(
                    f"block '{name}'", f"{first.dtype} on {first.device}", f"{block.dtype} on {block.device}"
                )
        self.terms = list(terms)
        self.layout = Layout.of(blocks)
        free = self.layout.free_mask(fixed or {}, first.device)
        self.structure = Structure(self.layout, self.terms, free, first.dtype)
        self.solver = choose_solver(solver, self.structure) if isinstance(solver, str) else solver

    def with_terms(self: _Problem, terms: Sequence[ElementTerm]) -> _Problem:
        """The same problem with other data, weights and losses of its terms; index maps and analysis are kept.

        Args:
            terms: On the same stencils as those before, in the same order.

        Raises:
            ShapeError: stencils differ, or other terms have elements and a weight.
        """
        result = copy.copy(self)
        result.terms = list(terms)
        result.structure = self.structure.with_terms(terms)
        if not result.structure.shares_pattern(self.structure):
            result.solver = copy.copy(self.solver)  # each keeps the analysis of its own pattern
        return result

    def check_blocks(self, blocks: State) -> None:
        """Raises ShapeError unless blocks have the sizes that the terms were compiled for."""
        if Layout.of(blocks) != self.layout:
            raise ShapeError("blocks", str(self.layout.sizes), str(Layout.of(blocks).sizes))

    def prepare(self) -> None:
        """Symbolic analysis; costs nothing where it is known."""
        self.solver.prepare(self.structure)
