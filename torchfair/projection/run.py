"""The loop over damped steps: clock, callback, Ctrl-C, history."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .._interrupts import Interrupts, deferred_interrupts
from ..progress import phase
from ..settings.projection_settings import ProjectionSettings
from .evaluate import culprit, residual_table
from .layout import State
from .problem import Problem
from .result import IterationRecord, ProjectionResult, Status, TermResidual, message_of
from .state import ProjectionState
from .steps import finished, init, record_of, step
from .stopwatch import Stopwatch
from .trials import Guard
from .unbegun import unbegun

_PARTS = ("linearise", "solve", "merit")

Callback = Callable[[IterationRecord], object]
Observe = Callable[[State], dict[str, float]]


class Run:
    """One run; make it, call :meth:`result` once.

    Args:
        problem, blocks, settings: See :func:`~torchfair.projection.init`.
        callback, observe, guard: See :func:`~torchfair.projection.guided_projection`.
    """

    def __init__(
        self,
        problem: Problem,
        blocks: State,
        settings: ProjectionSettings,
        callback: Callback | None,
        observe: Observe | None,
        guard: Guard | None,
    ) -> None:
        self._watch = Stopwatch()
        self._problem, self._callback, self._observe, self._guard = problem, callback, observe, guard
        self._blocks, self._settings = blocks, settings
        self._best: ProjectionState | None = None
        self._initial: list[TermResidual] = []
        self._quantities: dict[str, float] = {}
        self._history: list[IterationRecord] = []

    def result(self) -> ProjectionResult:
        """Steps until a tolerance, a limit, the callback or an interruption ends it.

        Functions of the problem and of the user may be interrupted; what is to be kept of them may not.
        """
        with deferred_interrupts() as interrupts:
            try:
                status = self._loop(interrupts)
            except KeyboardInterrupt:
                status = Status.INTERRUPTED
            if self._best is None:
                return unbegun(self._problem, self._blocks, self._watch)[0]
            return interrupts.insist(self._result, self._best, status)

    def _loop(self, interrupts: Interrupts) -> Status:
        problem = self._problem
        with phase("evaluating the start"):
            state = interrupts.interruptible(init, problem, self._blocks, self._settings)
        # The table and not the state: that would keep the Jacobians of the start.
        self._initial = interrupts.insist(residual_table, problem.structure, problem.terms, state.evaluation)
        self._best = state
        if self._stops(interrupts, record_of(state), state):
            return Status.CALLBACK
        limit = state.settings.time_limit
        while (status := finished(state)) is None:
            if limit is not None and self._watch.elapsed > limit:
                return Status.TIME_LIMIT
            state, record = interrupts.interruptible(step, problem, state, self._guard)
            self._best = state
            if finished(state) is not Status.SINGULAR and self._stops(interrupts, record, state):
                return Status.CALLBACK
        return status

    def _stops(self, interrupts: Interrupts, record: IterationRecord, state: ProjectionState) -> bool:
        """Keeps the record, with the observed quantities of the best state; True when the callback says stop."""
        record = replace(record, elapsed=self._watch.elapsed, quantities=dict(self._quantities))
        if record.accepted and self._observe is not None:
            self._history.append(replace(record, quantities={}))  # all that is known should it be interrupted
            self._quantities = interrupts.interruptible(self._observe, state.blocks)
            self._history.pop()
            record = replace(record, elapsed=self._watch.elapsed, quantities=dict(self._quantities))
        self._history.append(record)
        seen = replace(record, state=state)
        return self._callback is not None and bool(interrupts.interruptible(self._callback, seen))

    def _result(self, best: ProjectionState, status: Status) -> ProjectionResult:
        problem = self._problem
        detail = culprit(problem.structure, best.blocks) if status is Status.SINGULAR else ""
        timings = {part: sum(r.timings.get(part, 0.0) for r in self._history) for part in _PARTS}
        return ProjectionResult(
            blocks=best.blocks,
            status=status,
            message=message_of(status, self._history, detail),
            residuals=residual_table(problem.structure, problem.terms, best.evaluation),
            initial_residuals=self._initial,
            history=self._history,
            solver=problem.solver.name,
            timings={**timings, "total": self._watch.elapsed},
        )
