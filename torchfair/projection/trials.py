"""Candidates for the next state: every member of a batch takes the best of those it is offered."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from .layout import State
from .problem import Problem
from .proposal import Proposal
from .state import ProjectionState
from .stopwatch import Stopwatch
from .system import Evaluation

Guard = Callable[[State, State], bool]

LEAST_GAIN = 1e-4  # of the predicted fall of the merit, for a step to be taken
_ROUNDING = 2.0**-51  # falls below this fraction of the merit cannot be computed
_HALVINGS = 6  # of the step of unknowns whose elements leave their domain


class Trials:
    """States tried in one step.

    Args:
        problem, state: Where they start.
        proposal: What the model promises.
        guard: Refuses states.
        watch: Counts the time of merits.

    Attributes:
        gains: For each member, by how much the merit falls at the best candidate so far, over what was promised;
            minus infinity while there is none.
        merits: Its merit.
    """

    def __init__(
        self, problem: Problem, state: ProjectionState, proposal: Proposal, guard: Guard | None, watch: Stopwatch
    ) -> None:
        self._problem, self._state, self._proposal = problem, state, proposal
        self._guard, self._watch = guard, watch
        self._start = problem.layout.flatten(state.evaluation.state)
        self._active = [course.finished(state.settings) is None for course in state.courses]
        self._lost = [False for _ in state.courses]  # members whose step leads nowhere finite, in this attempt
        self._best: Evaluation | None = None
        self._change = torch.zeros_like(self._start)
        self._mixed = False
        self.merits = [course.merit for course in state.courses]
        self.gains = [-math.inf for _ in state.courses]

    def offer(self, change: Tensor, to: Sequence[bool] | None = None, *, again: bool = False) -> Evaluation | None:
        """Tries a step (N,); members for which it is the best so far take it.

        Args:
            change: The step. Where it leads to residuals that are not finite, it is shortened.
            to: Members that may take it, by default all.
            again: The gain of the first attempt stays what counts.

        Returns:
            The state after the step, also where it is not taken; None if it is finite for no member.
        """
        trial, change, merits, promised = self._finite(change)
        if trial is None:
            return None
        gains, takes = [], []
        for number, course in enumerate(self._state.courses):
            asked = self._active[number] and not self._lost[number] and (to is None or to[number])
            fall = course.merit - merits[number]
            gains.append(fall / promised[number] if asked and promised[number] > 0.0 else -math.inf)
            takes.append(gains[number] > LEAST_GAIN and fall > 0.0 and merits[number] < self.merits[number])
        if any(takes) and not self._admits(trial.state):
            return trial
        if not again:
            self.gains = [max(pair) for pair in zip(self.gains, gains, strict=True)]
        if all(takes):
            self._best, self._change, self._mixed, self.merits = trial, change, False, merits
        elif any(takes):
            chosen = self._problem.layout.member_spread(torch.tensor(takes, device=change.device))
            self._change, self._mixed = torch.where(chosen, change, self._change), True
            self.merits = [new if take else old for take, new, old in zip(takes, merits, self.merits, strict=True)]
        return trial

    def sizes(self) -> tuple[list[float], list[bool]]:
        """For each member, the largest change of an unknown, and whether the step promises nothing.

        That is so where it is below ``step_tolerance``, in units of stiffness, or where the fall of the merit that it
        promises is below rounding.
        """
        weights, layout, change = self._state.linearised.stiffness, self._problem.layout, self._proposal.change
        squares = [layout.member_sums(weights * part.square()) for part in (change, self._start)]
        short = squares[0] <= self._state.settings.step_tolerance**2 * squares[1]
        tiny = self._proposal.predicted <= _ROUNDING * self._state.evaluation.merits
        sizes, nothing = torch.stack([layout.member_largest(change.abs()), (short | tiny).to(change)]).tolist()
        return sizes, [number > 0.0 for number in nothing]

    @property
    def taken(self) -> list[bool]:
        """For each member, whether any candidate was good enough."""
        return [merit < course.merit for merit, course in zip(self.merits, self._state.courses, strict=True)]

    def best(self) -> Evaluation | None:
        """The state in which every member has its best candidate; None if no member moves."""
        return self._evaluate(self._start + self._change) if self._mixed else self._best

    def _finite(self, change: Tensor) -> tuple[Evaluation | None, Tensor, list[float], list[float]]:
        """The state after a step, the step, merits, and by how much they should have fallen.

        Where single elements are not finite, at the border of their domain, the step of their unknowns is halved, so
        that they do not stop all others.
        """
        structure, fall = self._problem.structure, self._proposal.predicted
        self._lost = [False for _ in self._lost]
        for _ in range(_HALVINGS):
            trial = self._evaluate(self._start + change)
            merits, promised = torch.stack([trial.merits, fall]).tolist()
            if all(map(math.isfinite, merits)):
                return trial, change, merits, promised
            change = torch.where(structure.unknowns_of_infinite_elements(trial), 0.5 * change, change)
            fall = self._proposal.system.predicted_fall(change)
        self._lost = [not math.isfinite(merit) for merit in merits]
        if all(self._lost):
            return None, change, [], []
        # Those that are nowhere finite stay where they are; they must not stop the other members.
        stay = torch.tensor(self._lost, device=change.device)
        change = torch.where(self._problem.layout.member_spread(stay), 0.0, change)
        trial = self._evaluate(self._start + change)
        merits, promised = torch.stack([trial.merits, self._proposal.system.predicted_fall(change)]).tolist()
        return trial, change, merits, promised

    def _admits(self, trial: State) -> bool:
        return self._guard is None or self._guard(self._state.evaluation.state, trial)

    def _evaluate(self, flat: Tensor) -> Evaluation:
        with self._watch.part("merit"):
            return self._problem.structure.evaluate(self._problem.layout.unflatten(flat))
