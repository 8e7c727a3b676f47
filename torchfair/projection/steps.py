"""Guided projection step by step: ``init``, ``step``, ``finished`` over an immutable state."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .damping import Damping
from .evaluate import check_linearised, check_start
from .inequalities import Inequalities
from .layout import State
from .problem import Problem
from .proposal import Proposal
from .result import IterationRecord, Status
from .settings import ProjectionSettings
from .state import Linearised, ProjectionState
from .stopwatch import Stopwatch
from .system import Evaluation, LinearSystem

Guard = Callable[[State, State], bool]

_LEAST_GAIN = 1e-4
_TIGHTEST_ACCURACY = 1e-8
_LONGEST_EXTRAPOLATION = 3.0
_PATIENCE_WHEN_DAMPED = 4


@torch.no_grad()
def init(problem: Problem, blocks: State, settings: ProjectionSettings | None = None) -> ProjectionState:
    """The state from which a run starts.

    Args:
        problem: Compiled terms, such as a :class:`~torchfair.projection.GuidedProjection`.
        blocks: Start ``name -> (n, d)``, of the sizes that the problem was compiled for. Not modified.
        settings: Tolerances and damping.

    Raises:
        ShapeError: blocks have other sizes.
        TorchfairError: a residual or Jacobian is not finite at the start; names the term and its elements.
    """
    settings = settings or ProjectionSettings()
    problem.check_blocks(blocks)
    evaluation = problem.structure.evaluate({name: block.detach().clone() for name, block in blocks.items()})
    check_start(problem.structure, evaluation)
    linearised = _linearise(problem, evaluation, settings)
    check_linearised(problem.structure, linearised.system)
    return ProjectionState(evaluation, linearised, settings, Damping(settings.initial_damping), settings.accuracy)


@torch.no_grad()
def step(
    problem: Problem, state: ProjectionState, guard: Guard | None = None
) -> tuple[ProjectionState, IterationRecord]:
    """One damped step.

    Args:
        problem: That of the state; its data and weights may have changed (see :meth:`Problem.with_terms`) if the state
            was made anew by :func:`init`.
        state: Not modified.
        guard: ``guard(blocks, trial)`` refuses a trial by returning False.

    Returns:
        The next state, equal in its blocks to the last one if the step was not accepted, and what happened.
    """
    watch = Stopwatch()
    problem.prepare()
    with watch.part("solve"):
        proposal, damping = _propose(problem, state)
    number = state.iteration + 1
    if proposal is None:
        record = _record(number, state, damping.value, math.nan, 0.0, False, 0, watch)
        return replace(state, iteration=number, damping=damping, status=Status.SINGULAR), record
    attempt = _Attempt(problem, state, guard, watch)
    flat = problem.layout.flatten(state.evaluation.state)
    trial = attempt.evaluate(flat + proposal.change)
    fall = -math.inf if trial is None else state.merit - trial.merit
    gain = fall / proposal.predicted if proposal.predicted > 0.0 else -math.inf
    size, reach = float(proposal.change.abs().max()), float(flat.abs().max())
    short = size <= state.settings.step_tolerance * (reach + state.settings.step_tolerance)
    after = replace(state, iteration=number, heeded=proposal.heeded)
    if trial is None or not (fall > 0.0 and gain > _LEAST_GAIN):
        after = replace(after, damping=damping.rejected())
        if short or after.damping.exhausted:
            after = replace(after, status=Status.STALLED)
        return after, _record(number, after, damping.value, gain, size, False, proposal.iterations, watch)
    best = attempt.extrapolated(trial, flat, proposal.change, gain)
    with watch.part("linearise"):
        linearised = _linearise(problem, best, state.settings)
    after = replace(after, evaluation=best, linearised=linearised, damping=damping.accepted(gain))
    after = _settled(problem, after, (state.merit - best.merit) / state.merit, damping.value)
    if short:
        after = replace(after, status=Status.STEP_TOLERANCE)
    return after, _record(number, after, damping.value, gain, size, True, proposal.iterations, watch)


def finished(state: ProjectionState) -> Status | None:
    """Why a run ends at this state; None if it goes on."""
    if state.status is not None:
        return state.status
    if state.merit == 0.0:
        return Status.ZERO_MERIT
    if state.gradient <= state.settings.gradient_tolerance:
        return Status.GRADIENT_TOLERANCE
    return Status.MAX_ITERATIONS if state.iteration >= state.settings.max_iterations else None


def _linearise(problem: Problem, evaluation: Evaluation, settings: ProjectionSettings) -> Linearised:
    system = problem.structure.linearise(evaluation)
    inequalities = Inequalities.of(system)
    if inequalities is not None:
        system = inequalities.heeding(inequalities.broken)
    scale = _scale(system, settings)
    gradient = float((system.gradient.abs() / scale.sqrt()).max())
    return Linearised(system, inequalities, scale, gradient)


def _scale(system: LinearSystem, settings: ProjectionSettings) -> Tensor:
    """Positive diagonal that the damping multiplies; one where nothing is felt."""
    if settings.damping_scale == "identity":
        return torch.ones_like(system.gradient)
    diagonal = system.diagonal
    floor = 1e-12 * float(diagonal.max())
    floored = diagonal.clamp_min(floor if 0.0 < floor < math.inf else 1.0)
    return torch.where(diagonal > 0.0, floored, torch.ones_like(diagonal))


def _propose(problem: Problem, state: ProjectionState) -> tuple[Proposal | None, Damping]:
    """A solution of the damped system, None where it is singular at every damping; and the damping it needed."""
    damping, at = state.damping, state.linearised
    while not damping.exhausted:
        diagonal = damping.value * at.scale
        try:
            if at.inequalities is None:
                factor = problem.solver.factorise(at.system, diagonal)
                return Proposal.of(at.system, factor, diagonal, state.accuracy), damping
            return at.inequalities.propose(problem.solver, diagonal, state.heeded, state.accuracy), damping
        except SingularSystemError:
            damping = damping.rejected()
    return None, damping


class _Attempt:
    """Trials of one step."""

    def __init__(self, problem: Problem, state: ProjectionState, guard: Guard | None, watch: Stopwatch) -> None:
        self._problem, self._state, self._guard, self._watch = problem, state, guard, watch

    def evaluate(self, flat: Tensor) -> Evaluation | None:
        """A state, unless the guard refuses it."""
        trial = self._problem.layout.unflatten(flat)
        if self._guard is not None and not self._guard(self._state.evaluation.state, trial):
            return None
        with self._watch.part("merit"):
            return self._problem.structure.evaluate(trial)

    def extrapolated(self, trial: Evaluation, flat: Tensor, change: Tensor, gain: float) -> Evaluation:
        """Goes on along a step that gained more than predicted, to the minimum of the parabola seen.

        A reweighted model lies above the merit: with a gain of 1.5 its curvature is twice too large, and
        the best step along the same line is twice as long.
        """
        factor = min(1.0 / (2.0 - gain), _LONGEST_EXTRAPOLATION) if gain < 2.0 else _LONGEST_EXTRAPOLATION
        if factor > self._state.settings.least_extrapolation:
            farther = self.evaluate(flat + factor * change)
            if farther is not None and farther.merit < trial.merit:
                return farther
        return trial


def _settled(problem: Problem, state: ProjectionState, fall: float, damping: float) -> ProjectionState:
    """Whether the merit has come to rest; if so, with an iterative linear solver also when that is tightened.

    Steps that heavy damping kept short say little, so more of them are waited for. A relative remainder
    changes the decrease of the merit by its square, hence the tightest one worth asking for.
    """
    settings = state.settings
    patience = settings.patience * (1 if damping <= settings.initial_damping else _PATIENCE_WHEN_DAMPED)
    falls = (*state.falls, fall)[-_PATIENCE_WHEN_DAMPED * settings.patience :]
    state = replace(state, falls=falls)
    if len(falls) < patience or max(falls[-patience:]) >= settings.merit_tolerance:
        return state
    tightest = max(0.1 * math.sqrt(settings.merit_tolerance), _TIGHTEST_ACCURACY)
    if problem.solver.inexact and state.accuracy > tightest:
        return replace(state, accuracy=max(0.1 * state.accuracy, tightest), falls=())
    return replace(state, status=Status.MERIT_TOLERANCE)


def _record(
    number: int,
    state: ProjectionState,
    damping: float,
    gain: float,
    size: float,
    accepted: bool,
    inner: int,
    watch: Stopwatch,
) -> IterationRecord:
    return IterationRecord(
        iteration=number,
        merit=state.merit,
        damping=damping,
        gain=gain,
        step=size,
        gradient=state.gradient,
        accepted=accepted,
        inner_iterations=inner,
        elapsed=0.0,
        timings=watch.parts,
    )
