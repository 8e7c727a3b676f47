"""The loop over damped steps: clock, callback, Ctrl-C, history."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .evaluate import culprit, residual_table
from .layout import State
from .problem import Problem
from .result import IterationRecord, ProjectionResult, Status
from .settings import ProjectionSettings
from .state import ProjectionState
from .steps import finished, init, record_of, step
from .stopwatch import Stopwatch
from .trials import Guard

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
        self._start = self._state = init(problem, blocks, settings)
        self._quantities: dict[str, float] = {}
        self._history: list[IterationRecord] = []

    def result(self) -> ProjectionResult:
        """Steps until a tolerance, a limit, the callback or an interruption ends it."""
        problem = self._problem
        try:
            status = self._loop()
        except KeyboardInterrupt:
            status = Status.INTERRUPTED
        detail = culprit(problem.structure, self._state.blocks) if status is Status.SINGULAR else ""
        timings = {part: sum(r.timings.get(part, 0.0) for r in self._history) for part in _PARTS}
        return ProjectionResult(
            blocks=self._state.blocks,
            status=status,
            message=f"{status.value}; {detail}" if detail else status.value,
            residuals=residual_table(problem.structure, problem.terms, self._state.evaluation),
            initial_residuals=residual_table(problem.structure, problem.terms, self._start.evaluation),
            history=self._history,
            solver=problem.solver.name,
            timings={**timings, "total": self._watch.elapsed},
        )

    def _loop(self) -> Status:
        state = self._start
        if self._stops(record_of(state), state):
            return Status.CALLBACK
        limit = state.settings.time_limit
        while (status := finished(self._state)) is None:
            if limit is not None and self._watch.elapsed > limit:
                return Status.TIME_LIMIT
            self._state, record = step(self._problem, self._state, self._guard)
            if finished(self._state) is not Status.SINGULAR and self._stops(record, self._state):
                return Status.CALLBACK
        return status

    def _stops(self, record: IterationRecord, state: ProjectionState) -> bool:
        """Keeps the record, with the observed quantities of the best state; True when the callback says stop."""
        if record.accepted and self._observe is not None:
            self._quantities = self._observe(state.blocks)
        record = replace(record, elapsed=self._watch.elapsed, quantities=dict(self._quantities))
        self._history.append(record)
        return self._callback is not None and bool(self._callback(replace(record, state=state)))
