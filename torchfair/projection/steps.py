"""Guided projection step by step: ``init``, ``step``, ``finished`` over an immutable state."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar, cast

import torch
from torch import Tensor

from .._memory import hand_back_free_memory
from .._threads import threads_for
from ..errors import SettingsError
from ..progress import phase
from ..settings.projection_settings import ProjectionSettings
from .candidates import try_candidates
from .certificate import certified
from .course import Course, Outcome, Standing
from .damped_solution import propose
from .damping import ConstantDamping, Damping
from .evaluate import check_linearised, check_start
from .evaluation import Evaluation
from .inequalities import Inequalities
from .layout import State
from .problem import Problem
from .result import IterationRecord, Status
from .state import Linearised, ProjectionState
from .stopwatch import Stopwatch
from .trials import Guard, Trials
from .vanishing import vanishing

_F = TypeVar("_F", bound=Callable[..., object])  # as it is, so that arguments have their names


def _plain(function: _F) -> _F:
    """Without gradients, and with few threads for small problems."""

    @wraps(function)
    def plainly(problem: Problem, *arguments: Any, **options: Any) -> object:
        with torch.no_grad(), threads_for(problem.layout.num_unknowns, problem.structure.device):
            return function(problem, *arguments, **options)

    return cast(_F, plainly)


@_plain
def init(problem: Problem, blocks: State, settings: ProjectionSettings | None = None) -> ProjectionState:
    """The state from which a run starts.

    Args:
        problem: Compiled terms, such as a :class:`~torchfair.projection.GuidedProjection`.
        blocks: Start ``name -> (n, d)``, of the sizes that the problem was compiled for. Not modified.
        settings: Tolerances and damping.

    Raises:
        ShapeError: blocks have other sizes.
        SettingsError: settings ask for another linear solver than the problem was made for.
        TorchfairError: a residual or Jacobian is not finite at the start; names the term and its elements.
    """
    settings = ProjectionSettings.given(settings)
    if problem.solved_by(settings.solver) is not problem:
        raise SettingsError(
            f"the problem was made for the linear solver '{problem.solver.name}', but settings ask for another one: "
            "make it with that one, or take problem.solved_by(settings.solver)"
        )
    problem.check_blocks(blocks)
    evaluation = problem.structure.evaluate({name: block.detach().clone() for name, block in blocks.items()})
    check_start(problem.structure, evaluation)
    hand_back_free_memory(problem.layout.num_unknowns)
    linearised, standings = _linearise(problem, evaluation, settings)
    check_linearised(problem.structure, linearised.system)
    damping = (ConstantDamping if settings.takes_every_step else Damping)(settings.initial_damping)
    courses = [
        Course(
            standing,
            damping,
            settings.accuracy,
            suspicion=Status.GRADIENT_TOLERANCE if standing.is_flat(settings) else None,
        )
        for standing in standings
    ]
    return _judged(problem, ProjectionState(evaluation, linearised, settings, tuple(courses)))


@_plain
def of_members(problem: Problem, state: ProjectionState, chosen: list[int]) -> tuple[Problem, ProjectionState]:
    """The problem and the state of some members of a batch alone, to go on without the others.

    Args:
        problem: Of one member.
        state: Of the batch.
        chosen: Numbers of members.
    """
    layout, before = state.linearised.system.structure.layout, state.linearised
    smaller = problem.batched(len(chosen))
    flat = layout.chosen_members(layout.flatten(state.evaluation.state), chosen)
    evaluation = smaller.structure.evaluate(smaller.layout.unflatten(flat))
    linearised, _ = _linearise(smaller, evaluation, state.settings)
    linearised = replace(linearised, stiffness=layout.chosen_members(before.stiffness, chosen))
    heeded = state.heeded
    if heeded is not None and before.inequalities is not None:
        heeded = before.inequalities.chosen_members(heeded, chosen)
    courses = tuple(state.courses[member] for member in chosen)
    return smaller, replace(state, evaluation=evaluation, linearised=linearised, courses=courses, heeded=heeded)


@_plain
def resume(problem: Problem, state: ProjectionState, blocks: State | None = None) -> ProjectionState:
    """The state from which a run goes on after data, weights or fixed unknowns of its problem have changed.

    Damping, accuracy and stiffness are carried on; iterations are counted and convergence is tested anew. Nothing is
    asked of the start; for that see :func:`init`.

    Args:
        problem: That of the state, with other data (``with_terms``, ``with_fixed``, or terms that refresh).
        state: Not modified.
        blocks: Where to go on, by default where the state is.

    Example::

        heavier = problem.with_terms(terms)
        state, record = step(heavier, resume(heavier, state))
    """
    evaluation = problem.structure.evaluate(state.blocks if blocks is None else dict(blocks))
    linearised, standings = _linearise(problem, evaluation, state.settings, state.linearised.stiffness)
    courses = tuple(
        Course(standing, before.damping, before.accuracy)
        for standing, before in zip(standings, state.courses, strict=True)
    )
    inequalities = linearised.inequalities
    kept = inequalities is not None and state.heeded is not None and inequalities.broken.shape == state.heeded.shape
    return ProjectionState(evaluation, linearised, state.settings, courses, state.heeded if kept else None)


@_plain
def step(
    problem: Problem, state: ProjectionState, guard: Guard | None = None
) -> tuple[ProjectionState, IterationRecord]:
    """One damped step.

    Args:
        problem: That of the state.
        state: Not modified.
        guard: ``guard(blocks, trial)`` refuses a trial by returning False; not asked where every step is taken.

    Returns:
        The next state, equal in its blocks to the last one if the step was not accepted, and what happened.
    """
    watch, settings = Stopwatch(), state.settings
    problem.prepare()
    with watch.part("solve"):
        proposal, dampings = propose(problem, state)
    if proposal is None:
        ended = tuple(
            course if course.finished(settings) else _singular(course, damping)
            for course, damping in zip(state.courses, dampings, strict=True)
        )
        after = replace(state, courses=ended)
        return after, record_of(after, timings=watch.parts)
    proposal.system.spare()  # a correction makes them anew; trials need the memory
    hand_back_free_memory(problem.layout.num_unknowns)
    trials = Trials(problem, state, proposal, guard, watch)
    try_candidates(trials, proposal, state)
    best = trials.best()
    outcomes = list(map(Outcome, dampings, trials.gains, *trials.sizes(), trials.taken, trials.halvings))
    linearised, standings = state.linearised, [course.standing for course in state.courses]
    lost, heeded, iterations = proposal.lost, proposal.heeded, proposal.iterations
    if best is not None:
        proposal.system.release()
        state.linearised.system.forget()
        del trials, proposal  # with the factor, before the next Jacobians are made
        hand_back_free_memory(problem.layout.num_unknowns)
        with watch.part("linearise"):
            linearised, standings = _linearise(problem, best, settings, state.linearised.stiffness)
    courses = [
        _after(course, outcome, standing, settings, inexact=problem.solver.inexact, lost=number in lost)
        for number, (course, outcome, standing) in enumerate(zip(state.courses, outcomes, standings, strict=True))
    ]
    evaluation = best or state.evaluation
    after = replace(state, evaluation=evaluation, linearised=linearised, courses=tuple(courses))
    after = replace(after, heeded=heeded)
    with watch.part("solve"):
        after = _judged(problem, after)
    hand_back_free_memory(problem.layout.num_unknowns)
    return after, record_of(after, inner_iterations=iterations, timings=watch.parts)


def finished(state: ProjectionState) -> Status | None:
    """Why a run ends at this state; None if it goes on. A batch goes on while a member does."""
    statuses = [course.finished(state.settings) for course in state.courses]
    return None if None in statuses else statuses[0]


def _linearise(
    problem: Problem, evaluation: Evaluation, settings: ProjectionSettings, stiffness: Tensor | None = None
) -> tuple[Linearised, list[Standing]]:
    """What the next steps need, and where each member stands."""
    layout, system = problem.layout, problem.structure.linearise(evaluation)
    inequalities = Inequalities.of(system)
    if inequalities is not None:
        system = inequalities.heeding(inequalities.broken)
    diagonal = system.diagonal
    slopes = system.gradient.abs() / torch.where(diagonal > 0.0, diagonal, 1.0).sqrt()
    lengths = (2.0 * evaluation.merits).sqrt()
    cosines = layout.member_largest(slopes) / torch.where(lengths > 0.0, lengths, 1.0)
    sizes = layout.member_sums(diagonal * layout.flatten(evaluation.state).square())
    floors = 0.5 * settings.step_tolerance**2 * sizes
    numbers = torch.stack([evaluation.merits, cosines, floors], 1).tolist()
    if any(merit <= floor and merit > 0.0 for merit, _, floor in numbers):
        zero = vanishing(system, evaluation.state, settings.step_tolerance).tolist()
        numbers = [[*row[:2], row[2] if small else 0.0] for row, small in zip(numbers, zero, strict=True)]
    stiffest = diagonal if stiffness is None else torch.maximum(diagonal, stiffness)
    return Linearised(system, inequalities, stiffest), [Standing(*row) for row in numbers]


def _judged(problem: Problem, state: ProjectionState) -> ProjectionState:
    """Members that are suspected to be at a minimum either are there, or go on."""
    if not any(course.suspicion for course in state.courses):
        return state
    chosen = state.settings.when_settled
    if chosen == "stop":
        answers = [False] * len(state.courses)
    else:
        problem.prepare()
        with phase("looking whether this is a minimum"):
            answers = certified(problem, state)
    courses = [
        course.judged(certified=answer, goes_on=chosen == "go on") if course.suspicion else course
        for course, answer in zip(state.courses, answers, strict=True)
    ]
    return replace(state, courses=tuple(courses))


def _after(
    course: Course, outcome: Outcome, standing: Standing, settings: ProjectionSettings, *, inexact: bool, lost: bool
) -> Course:
    if course.finished(settings):
        return course
    if lost:
        return _singular(course, outcome.damping)
    return course.after(outcome, standing, settings, inexact=inexact)


def _singular(course: Course, damping: Damping) -> Course:
    """One for which no damping is enough."""
    last = Outcome(damping, -math.inf, 0.0, False, False)
    return replace(course, iteration=course.iteration + 1, last=last, status=Status.SINGULAR)


def record_of(
    state: ProjectionState, member: int = 0, *, inner_iterations: int = 0, timings: dict[str, float] | None = None
) -> IterationRecord:
    """What became of the last step of a member; of the start where no step has been made."""
    course = state.courses[member]
    last = course.last or Outcome(Damping(math.nan), math.nan, 0.0, False, True)
    return IterationRecord(
        iteration=course.iteration,
        merit=course.merit,
        damping=last.damping.value,
        gain=last.gain,
        step=last.size,
        gradient=course.gradient,
        accepted=last.accepted,
        inner_iterations=inner_iterations,
        elapsed=0.0,
        timings=timings or {},
    )
