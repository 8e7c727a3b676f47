"""Live steps of a session: accepted damped steps, one after the other, while handles are dragged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ...projection import (
    GuidedProjection,
    IterationRecord,
    ProjectionState,
    Status,
    finished,
    init,
    resume,
    step,
)
from ...projection.layout import State
from .plan import Stage
from .recipe import Recipe

_MOST_TRIALS = 12  # damped steps tried in one live step
_MOST_STEPS = 4  # of them that are accepted, more than one only where handles stay behind
_LARGEST_LAG = 0.01  # mean edge lengths
_WORTHWHILE = 0.8  # to which the lag has to fall in a step for another one
_ENDLESS = 10**9


@dataclass(frozen=True)
class Progress:
    """What a live step did.

    Attributes:
        accepted: Whether the mesh has moved.
        reason: Why it has not; empty if it has.
        record: Of the last damped step; None if none was needed.
        trials: Damped steps tried.
    """

    accepted: bool
    reason: str
    record: IterationRecord | None
    trials: int


@dataclass
class Following:
    """Where live steps stand.

    Attributes:
        stage: What they solve.
        problem: The same, compiled.
        state: Of guided projection.
    """

    stage: Stage
    problem: GuidedProjection
    state: ProjectionState


def followed(stage: Stage, compiled: Callable[[Stage], GuidedProjection], before: Following | None = None) -> Following:
    """Where live steps of a stage begin, or go on from where they stood ``before``."""
    stage = replace(stage, settings=replace(stage.settings, max_iterations=_ENDLESS, when_settled="stop"))
    problem = compiled(stage)
    if before is None:
        return Following(stage, problem, init(problem, stage.blocks, replace(stage.settings, solver="auto")))
    return Following(stage, problem, resume(problem, before.state, stage.blocks))


def live_step(following: Following, recipe: Recipe[Any], blocks: State) -> tuple[Progress, ProjectionState, State]:
    """One accepted damped step, or more where it was too short for a handle; changes nothing.

    Args:
        following: Where live steps stand.
        recipe: The job.
        blocks: The mesh.

    Returns:
        What was done, where guided projection stands then, and the mesh.
    """
    state, record, trials, accepted = following.state, None, 0, 0
    lag = recipe.pulls.lag(recipe.placed(blocks))
    while trials < _MOST_TRIALS and finished(state) is None:
        state, record = step(following.problem, state, following.stage.guard)
        trials, accepted = trials + 1, accepted + record.accepted
        if record.accepted:
            blocks = following.stage.result(state.blocks)
            before, lag = lag, recipe.pulls.lag(recipe.placed(blocks))
            if accepted == _MOST_STEPS or lag <= _LARGEST_LAG or lag > _WORTHWHILE * before:
                break
    reason = "" if accepted else _reason(finished(state))
    return Progress(bool(accepted), reason, record, trials), state, blocks


def _reason(status: Status | None) -> str:
    if status is None:
        return "no step is accepted here: damping rises, try again, pull less or loosen the guards"
    return "at rest" if status.at_rest else status.value
