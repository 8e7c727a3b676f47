"""One run of the damped iteration: the current state, the damping and the history."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .damping import Damping
from .evaluate import check_start, culprit, residual_table
from .inequalities import Inequalities, Proposal
from .layout import State
from .result import IterationRecord, ProjectionResult, Status
from .settings import ProjectionSettings
from .system import Evaluation, LinearSystem

if TYPE_CHECKING:
    from .guided_projection import GuidedProjection

Callback = Callable[[IterationRecord], object]
Observe = Callable[[State], dict[str, float]]
Guard = Callable[[State, State], bool]

_LEAST_GAIN = 1e-4
_TIGHTEST_ACCURACY = 1e-8
_LONGEST_EXTRAPOLATION = 3.0
_PATIENCE_WHEN_DAMPED = 4


class Iteration:
    """One run; make it, call :meth:`run` once."""

    def __init__(
        self,
        problem: GuidedProjection,
        blocks: State,
        settings: ProjectionSettings,
        callback: Callback | None,
        observe: Observe | None,
        guard: Guard | None,
    ) -> None:
        self.problem, self.settings = problem, settings
        self.callback, self.observe, self.guard = callback, observe, guard
        self.begin = time.perf_counter()
        self.timings = {"linearise": 0.0, "solve": 0.0, "merit": 0.0}
        self.best = self._evaluate({name: block.detach().clone() for name, block in blocks.items()})
        check_start(problem.structure, self.best)
        self.initial_residuals = residual_table(problem.structure, problem.terms, self.best)
        self.damping = Damping(settings.initial_damping)
        self.accuracy = settings.accuracy
        self.quantities: dict[str, float] = {}
        self.history: list[IterationRecord] = []
        self.recent: list[float] = []
        self.heeded: Tensor | None = None

    def run(self) -> ProjectionResult:
        """Iterates until a tolerance, a limit, the callback or an interruption ends it."""
        detail = ""
        try:
            start = IterationRecord(0, self.best.merit, math.nan, math.nan, 0.0, math.nan, True, 0, 0.0)
            if self._record(start):
                status = Status.CALLBACK
            elif self.best.merit == 0.0:
                status = Status.ZERO_MERIT
            else:
                self.problem.prepare()
                status, detail = self._iterate()
        except KeyboardInterrupt:
            status = Status.INTERRUPTED
        return ProjectionResult(
            blocks=dict(self.best.state),
            status=status,
            message=f"{status.value}; {detail}" if detail else status.value,
            residuals=residual_table(self.problem.structure, self.problem.terms, self.best),
            initial_residuals=self.initial_residuals,
            history=self.history,
            solver=self.problem.solver.name,
            timings={**self.timings, "total": self._elapsed()},
        )

    def _iterate(self) -> tuple[Status, str]:
        number = 0
        while True:
            with self._timed("linearise"):
                system = self.problem.structure.linearise(self.best)
                inequalities = Inequalities.of(system)
                if inequalities is not None:
                    system = inequalities.heeding(inequalities.broken)
                scale = self._scale(system)
                gradient = float((system.gradient.abs() / scale.sqrt()).max())
            if gradient <= self.settings.gradient_tolerance:
                return Status.GRADIENT_TOLERANCE, ""
            accepted = False
            while not accepted:
                if number >= self.settings.max_iterations:
                    return Status.MAX_ITERATIONS, ""
                if self.settings.time_limit is not None and self._elapsed() > self.settings.time_limit:
                    return Status.TIME_LIMIT, ""
                proposal = self._damped_step(system, inequalities, scale)
                if proposal is None:
                    return Status.SINGULAR, culprit(self.problem.structure, self.best.state)
                number += 1
                accepted, status = self._try(proposal, number, gradient)
                if status is not None:
                    return status, ""

    def _damped_step(self, system: LinearSystem, inequalities: Inequalities | None, scale: Tensor) -> Proposal | None:
        """A solution of the damped system; None where it is singular at every damping."""
        while True:
            damping = self.damping.value * scale
            try:
                with self._timed("solve"):
                    solve = partial(self.problem.solver.solve, damping=damping, accuracy=self.accuracy)
                    if inequalities is None:
                        return Proposal.of(system, solve(system), damping)
                    proposal, self.heeded = inequalities.propose(solve, damping, self.heeded)
                    return proposal
            except SingularSystemError:
                if not self.damping.reject():
                    return None

    def _try(self, proposal: Proposal, number: int, gradient: float) -> tuple[bool, Status | None]:
        """Takes the step if it lowers the merit; says whether it did, and why to stop."""
        damping, before = self.damping.value, self.best.merit
        change, predicted = proposal.change, proposal.predicted
        flat = self.problem.layout.flatten(self.best.state)
        trial = self._trial(flat + change)
        fall = -math.inf if trial is None else before - trial.merit
        gain = fall / predicted if predicted > 0.0 else -math.inf
        size, reach = float(change.abs().max()), float(flat.abs().max())
        accepted = fall > 0.0 and gain > _LEAST_GAIN
        if accepted and trial is not None:
            self.best = trial
            self._extrapolate(flat, change, gain)
            self.damping.accept(gain)
        record = IterationRecord(
            number, self.best.merit, damping, gain, size, gradient, accepted, proposal.iterations, self._elapsed()
        )
        if self._record(record):
            return accepted, Status.CALLBACK
        if size <= self.settings.step_tolerance * (reach + self.settings.step_tolerance):
            return accepted, Status.STEP_TOLERANCE if accepted else Status.STALLED
        if accepted:
            return True, self._settled(before, damping)
        return False, None if self.damping.reject() else Status.STALLED

    def _extrapolate(self, flat: Tensor, change: Tensor, gain: float) -> None:
        """Goes on along a step that gained more than predicted, to the minimum of the parabola seen.

        A reweighted model lies above the merit: with a gain of 1.5 its curvature is twice too large, and
        the best step along the same line is twice as long.
        """
        factor = min(1.0 / (2.0 - gain), _LONGEST_EXTRAPOLATION) if gain < 2.0 else _LONGEST_EXTRAPOLATION
        if factor > self.settings.least_extrapolation:
            trial = self._trial(flat + factor * change)
            if trial is not None and trial.merit < self.best.merit:
                self.best = trial

    def _settled(self, before: float, damping: float) -> Status | None:
        """Whether the merit has come to rest; if so, with an iterative linear solver also when that is tightened.

        Steps that heavy damping kept short say little, so more of them are waited for. A relative remainder
        changes the decrease of the merit by its square, hence the tightest one worth asking for.
        """
        if self.best.merit == 0.0:
            return Status.ZERO_MERIT
        settings = self.settings
        patience = settings.patience * (1 if damping <= settings.initial_damping else _PATIENCE_WHEN_DAMPED)
        self.recent.append((before - self.best.merit) / before)
        if len(self.recent) < patience or max(self.recent[-patience:]) >= settings.merit_tolerance:
            return None
        tightest = max(0.1 * math.sqrt(settings.merit_tolerance), _TIGHTEST_ACCURACY)
        if self.problem.solver.inexact and self.accuracy > tightest:
            self.accuracy = max(0.1 * self.accuracy, tightest)
            self.recent = []
            return None
        return Status.MERIT_TOLERANCE

    def _scale(self, system: LinearSystem) -> Tensor:
        """Positive diagonal that the damping multiplies; one where nothing is felt."""
        if self.settings.damping_scale == "identity":
            return torch.ones_like(system.gradient)
        diagonal = system.diagonal
        floor = 1e-12 * float(diagonal.max())
        floored = diagonal.clamp_min(floor if 0.0 < floor < math.inf else 1.0)
        return torch.where(diagonal > 0.0, floored, torch.ones_like(diagonal))

    def _trial(self, flat: Tensor) -> Evaluation | None:
        """A state, unless the guard refuses it."""
        state = self.problem.layout.unflatten(flat)
        refused = self.guard is not None and not self.guard(self.best.state, state)
        return None if refused else self._evaluate(state)

    def _evaluate(self, state: State) -> Evaluation:
        with self._timed("merit"):
            return self.problem.structure.evaluate(state)

    @contextmanager
    def _timed(self, what: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.timings[what] += time.perf_counter() - start

    def _elapsed(self) -> float:
        return time.perf_counter() - self.begin

    def _record(self, record: IterationRecord) -> bool:
        """Keeps the record, with the observed quantities of the best state; True when the callback says stop."""
        if record.accepted and self.observe is not None:
            self.quantities = self.observe(self.best.state)
        record.quantities.update(self.quantities)
        self.history.append(record)
        return bool(self.callback(record)) if self.callback is not None else False
