"""Guided projection: Levenberg-Marquardt on element terms, with a merit that never rises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from .._shown import shown
from .._threads import threads_for
from ..errors import ShapeError
from ..settings.projection_settings import ProjectionSettings
from .batch import BatchRun
from .differentiation import Way
from .layout import State
from .problem import Problem
from .result import ProjectionResult
from .run import Callback, Observe, Run
from .term import ElementTerm
from .trials import Guard


def guided_projection(
    blocks: State,
    terms: Sequence[ElementTerm],
    *,
    fixed: Mapping[str, Tensor] | None = None,
    settings: ProjectionSettings | None = None,
    derivatives: Way | None = None,
    callback: Callback | None = None,
    observe: Observe | None = None,
    guard: Guard | None = None,
) -> ProjectionResult:
    """Lowers the sum of ``terms`` from ``blocks`` on by damped Gauss-Newton steps.

    Each step solves ``(J^T J + damping * scale) d = -J^T r`` and is taken only if the merit, the sum of the
    true losses of all terms, falls. Constraints are terms with large weights, targets terms with small ones
    (guided projection after Tang et al. 2014; paper section 5.1). As printed there every step is taken, with constant
    damping: ``ProjectionSettings(step_policy="every")``.

    The solve is not differentiated through: blocks and data that require gradients are detached, silently, and the
    result requires none.

    Args:
        blocks: Start, ``name -> (n, d)``, all float32 or all float64, on one device. Not modified.
        terms: What is to be small. See :class:`ElementTerm`.
        fixed: Masks ``(n,)`` or ``(n, d)`` by block name, True where an unknown stays as it is.
        settings: Tolerances, damping, linear solver.
        derivatives: How all residuals are differentiated, by default what each term says; see :class:`ElementTerm`.
        callback: Called with every :class:`IterationRecord`, which then also holds the state; returning True stops
            the iteration.
        observe: Named quantities of a state to keep in the history.
        guard: ``guard(state, trial)`` refuses a trial state by returning False; the step then counts as
            one that does not lower the merit. Not asked where settings say that every step is taken.

    Returns:
        The best state found; where every step is taken (``step_policy``), the last one, which may be worse than the
        start. Interrupting (Ctrl-C) returns it too, with ``Status.INTERRUPTED``.

    Raises:
        ShapeError: blocks, terms or masks do not fit together, or a function of a term returns something else
            than a tensor of the right shape and dtype.
        SettingsError: unknown linear solver, or settings that are none.
        TorchfairError: a residual or Jacobian is not finite at the start; names the term and its elements. Likewise
            where a function of a term raises an error, which is its cause, a closed form is not the derivative, or a
            linear term is not linear.
    """
    settings = ProjectionSettings.given(settings)
    problem = GuidedProjection(blocks, terms, fixed=fixed, solver=settings.solver, derivatives=derivatives)
    return problem.solve(blocks, settings=settings, callback=callback, observe=observe, guard=guard)


class GuidedProjection(Problem):
    """Terms compiled for blocks of given sizes; solves from many starts with one symbolic analysis.

    Args:
        blocks: Example blocks ``(n, d)``; only sizes, dtype and device matter.
        terms, fixed, derivatives: See :func:`guided_projection`.
        solver: Name of a linear solver, or an object with that protocol.
    """

    def solve(
        self,
        blocks: State,
        *,
        settings: ProjectionSettings | None = None,
        callback: Callback | None = None,
        observe: Observe | None = None,
        guard: Guard | None = None,
    ) -> ProjectionResult:
        """Iterates from ``blocks``; see :func:`guided_projection`.

        The linear solver is that of the constructor, unless the settings name another one, which is then kept for the
        next time.
        """
        settings = ProjectionSettings.given(settings)
        problem = self.solved_by(settings.solver)
        with torch.no_grad(), threads_for(self.layout.num_unknowns, self.structure.device):
            return Run(problem, blocks, settings, callback, observe, guard).result()

    def solve_batch(self, blocks: State, *, settings: ProjectionSettings | None = None) -> list[ProjectionResult]:
        """Iterates from every member of blocks ``(batch, n, d)`` at once, one result each.

        The members share terms and fixed unknowns. They are solved as one system with their block structure, which is
        many times as fast as one after the other where they are small. Damping, acceptance and convergence are those of
        each member, so results are the same up to rounding. A member whose part of the system is singular gets more
        damping, and ends alone if it stays singular; an iterative solver or one of your own that cannot name the member
        raises the damping of all, unless a derivative that is not finite tells which one it is.

        Raises:
            ShapeError: blocks are not ``(batch, n, d)`` of the sizes compiled for.
            TorchfairError: see :func:`guided_projection`.
        """
        settings = ProjectionSettings.given(settings)
        given = list(blocks.values()) if isinstance(blocks, Mapping) else []
        counts = {len(block) for block in given if isinstance(block, Tensor) and block.ndim == 3}
        if len(counts) != 1 or not all(isinstance(block, Tensor) and block.ndim == 3 for block in given):
            raise ShapeError("blocks", "(batch, n, d) with one batch size", [shown(block) for block in given])
        if counts == {0}:
            return []
        self.check_blocks({name: block[0] for name, block in blocks.items()})
        size = self.layout.num_unknowns * counts.pop()
        with torch.no_grad(), threads_for(size, self.structure.device):
            return BatchRun(self.solved_by(settings.solver), blocks, settings).results()
