"""Stages of a job: what each run of guided projection is to do, and which comes next."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from torch import Tensor

from ...projection import ElementTerm, ProjectionResult, ProjectionSettings
from ...projection.layout import State
from ...projection.trials import Guard

Terms = Callable[[], Sequence[ElementTerm]]


def _same(state: State) -> State:
    return state


@dataclass(frozen=True)
class Stage:
    """One run of guided projection.

    Attributes:
        name: Stages of one name have the same unknowns and stencils, so that index maps and analysis are shared.
        blocks: Where it starts.
        terms: Makes what is to be small; called only where ``version`` is another than that of the last stage of this
            name.
        version: Equal for equal terms, but for data that they refresh.
        settings: Of the run.
        fixed: Masks of unknowns that do not move, by block name.
        guard: Refuses trial states.
        result: The state of the job after the run, for its blocks; the same unless unknowns are others than those.
        anew: Whether stencils may differ from those of the last stage of this name.
    """

    name: str
    blocks: State
    terms: Terms
    version: object
    settings: ProjectionSettings
    fixed: Mapping[str, Tensor] = field(default_factory=dict)
    guard: Guard | None = None
    result: Callable[[State], State] = _same
    anew: bool = False


_REST = 1e-2  # relative fall of the merit in one step
_LARGEST_DAMPING = 0.1  # where live steps were refused
_SMALLEST_DAMPING = 3e-3  # where they were short: what follows goes farther


def at_rest(stage: Stage, damping: float | None) -> Stage:
    """The stage, ended as soon as a step changes the merit by little, which the eye takes for rest.

    Args:
        stage: What live steps do.
        damping: Where it goes on.
    """
    settings = replace(stage.settings, merit_tolerance=_REST, patience=1, when_settled="stop")
    return replace(stage, settings=going_on(settings, None if damping is None else max(damping, _SMALLEST_DAMPING)))


def going_on(settings: ProjectionSettings, damping: float | None) -> ProjectionSettings:
    """The settings with the damping of the last live step; as they are if there was none."""
    if damping is None:
        return settings
    return replace(settings, initial_damping=min(damping, _LARGEST_DAMPING))


Stages = Generator[Stage, ProjectionResult, None]


class Plan(ABC):
    """Which stages lead from a state to what a job asks for.

    Attributes:
        state: The blocks so far. Whoever carries out a stage puts its result there before asking for the next.
    """

    def __init__(self, state: State) -> None:
        self.state = state

    @abstractmethod
    def stages(self) -> Stages:
        """The stages one after the other; each ``yield`` is the run that came of it."""

    def best(self) -> State:
        """Asked for once, at the end or where someone stopped: the state to keep, by default the last one."""
        return self.state


class OneStage(Plan):
    """A plan of a single stage."""

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage.blocks)
        self._stage = stage

    def stages(self) -> Stages:
        """That stage."""
        yield self._stage
