"""Guided projection: Levenberg-Marquardt on element terms, with a merit that never rises."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from ..errors import ShapeError
from .iteration import Callback, Guard, Iteration, Observe
from .layout import Layout, State
from .linear import LinearSolver, choose_solver
from .linear.direct import SparseDirect
from .result import ProjectionResult
from .settings import ProjectionSettings
from .system import Structure
from .term import ElementTerm
from .threads import threads_for


def guided_projection(
    blocks: State,
    terms: Sequence[ElementTerm],
    *,
    fixed: Mapping[str, Tensor] | None = None,
    settings: ProjectionSettings | None = None,
    callback: Callback | None = None,
    observe: Observe | None = None,
    guard: Guard | None = None,
) -> ProjectionResult:
    """Lowers the sum of ``terms`` from ``blocks`` on by damped Gauss-Newton steps.

    Each step solves ``(J^T J + damping * scale) d = -J^T r`` and is taken only if the merit, the sum of the
    true losses of all terms, falls. Constraints are terms with large weights, targets terms with small ones
    (guided projection after Tang et al. 2014; paper section 5.1).

    Args:
        blocks: Start, ``name -> (n, d)``, all of one floating dtype and device. Not modified.
        terms: What is to be small. See :class:`ElementTerm`.
        fixed: Masks ``(n,)`` or ``(n, d)`` by block name, True where an unknown stays as it is.
        settings: Tolerances, damping, linear solver.
        callback: Called with every :class:`IterationRecord`; returning True stops the iteration.
        observe: Named quantities of a state to keep in the history.
        guard: ``guard(state, trial)`` refuses a trial state by returning False; the step then counts as
            one that does not lower the merit.

    Returns:
        The best state found. Interrupting (Ctrl-C) returns it too, with ``Status.INTERRUPTED``.

    Raises:
        ShapeError: blocks, terms or masks do not fit together.
        TorchfairError: a residual or Jacobian is not finite at the start; names the term and its elements.
    """
    settings = settings or ProjectionSettings()
    problem = GuidedProjection(blocks, terms, fixed=fixed, solver=settings.solver)
    return problem.solve(blocks, settings=settings, callback=callback, observe=observe, guard=guard)


class GuidedProjection:
    """Terms compiled for blocks of given sizes; solves from many starts with one symbolic analysis.

    Args:
        blocks: Example blocks ``(n, d)``; only sizes, dtype and device matter.
        terms, fixed: See :func:`guided_projection`.
        solver: Name of a linear solver, or an object with that protocol.
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
        self._prepared = False

    def with_terms(self, terms: Sequence[ElementTerm]) -> GuidedProjection:
        """The same problem with other data, weights and losses of its terms; index maps and analysis are kept.

        Args:
            terms: On the same stencils as those before, in the same order.

        Raises:
            ShapeError: stencils differ, or other terms have elements and a weight.
        """
        result = copy.copy(self)
        result.terms = list(terms)
        result.structure = self.structure.with_terms(terms)
        kept = isinstance(self.solver, SparseDirect) and result.structure.shares_pattern(self.structure)
        result._prepared = self._prepared and kept
        result.solver = self.solver if kept else copy.copy(self.solver)
        return result

    def solve(
        self,
        blocks: State,
        *,
        settings: ProjectionSettings | None = None,
        callback: Callback | None = None,
        observe: Observe | None = None,
        guard: Guard | None = None,
    ) -> ProjectionResult:
        """Iterates from ``blocks``; see :func:`guided_projection`. The linear solver is that of the constructor."""
        if Layout.of(blocks) != self.layout:
            raise ShapeError("blocks", str(self.layout.sizes), str(Layout.of(blocks).sizes))
        with torch.no_grad(), threads_for(self.layout.num_unknowns, self.structure.free.device):
            run = Iteration(self, blocks, settings or ProjectionSettings(), callback, observe, guard)
            return run.run()

    def solve_batch(self, blocks: State, *, settings: ProjectionSettings | None = None) -> list[ProjectionResult]:
        """Iterates from every member of blocks ``(batch, n, d)``, one result each."""
        counts = {block.shape[0] for block in blocks.values()}
        if len(counts) != 1 or any(block.ndim != 3 for block in blocks.values()):
            shapes = [tuple(block.shape) for block in blocks.values()]
            raise ShapeError("blocks", "(batch, n, d) with one batch size", shapes)
        members = [{name: block[i] for name, block in blocks.items()} for i in range(counts.pop())]
        return [self.solve(member, settings=settings) for member in members]

    def prepare(self) -> None:
        """Symbolic analysis, once."""
        if not self._prepared:
            self.solver.prepare(self.structure)
            self._prepared = True
