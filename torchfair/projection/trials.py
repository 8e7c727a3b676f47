"""Candidates for the next state: every member of a batch takes the best of those it is offered."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor

from .attempts import Attempts, Spoilt
from .evaluation import Evaluation
from .layout import State
from .mixed_evaluation import with_members
from .portions import are_many
from .problem import Problem
from .proposal import Proposal
from .state import ProjectionState
from .stopwatch import Stopwatch

Guard = Callable[[State, State], bool]

LEAST_GAIN = 1e-4  # of the predicted fall of the merit, for a step to be taken
_ROUNDING = 2.0**-51  # falls below this fraction of the merit cannot be computed
_FEW = 0.75  # share of members up to which it pays to evaluate them alone
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
        taken: Whether there is any.
        halvings: How often it had to be halved as a whole.
    """

    def __init__(
        self, problem: Problem, state: ProjectionState, proposal: Proposal, guard: Guard | None, watch: Stopwatch
    ) -> None:
        self._problem, self._state, self._proposal = problem, state, proposal
        self._guard, self._watch = guard, watch
        self._start = problem.layout.flatten(state.evaluation.state)
        self._active = [
            number
            for number, course in enumerate(state.courses)
            if course.finished(state.settings) is None and number not in proposal.lost
        ]
        self._promised: list[float] = proposal.predicted.tolist()
        self._best, self._change = state.evaluation, torch.zeros_like(self._start)
        self.merits = [course.merit for course in state.courses]
        self.gains = [-math.inf for _ in state.courses]
        self.taken = [False for _ in state.courses]
        self.halvings = [0 for _ in state.courses]

    def offer(self, change: Tensor, to: Sequence[bool] | None = None, *, again: bool = False) -> Evaluation | None:
        """Tries a step (N,); members for which it is the best so far take it.

        Args:
            change: The step. Where it leads to residuals that are not finite, it is shortened.
            to: Members that may take it, by default all; no others are evaluated where that saves time.
            again: The gain of the first attempt stays what counts.

        Returns:
            The state of all members after the step, also where it is not taken; None if it is finite for no member, or
            was not tried by all.
        """
        asked = [number for number in self._active if to is None or to[number]]
        if not asked:
            return None
        count = len(self.merits)
        few = to is not None and self._guard is None and len(asked) <= _FEW * count
        tried = self._finite(change, asked if few else range(count))
        if tried is None:
            return None
        whole = tried.trial if len(tried.seen) == count else None
        gains, takes, rows = [-math.inf] * count, [], {number: row for row, number in enumerate(tried.seen)}
        for number in asked:
            merit, promised = tried.merits[rows[number]], tried.promised[number]
            fall = self._state.courses[number].merit - merit
            gains[number] = fall / promised if promised > 0.0 else -math.inf
            if gains[number] > LEAST_GAIN and fall > 0.0 and merit < self.merits[number]:
                takes.append(number)
        if takes and not self._admits(tried.trial.state):
            return whole
        if not again:
            self.gains = [max(pair) for pair in zip(self.gains, gains, strict=True)]
        self._take(tried, takes, [rows[number] for number in takes])
        return whole

    def take(self, change: Tensor) -> None:
        """Takes a step (N,) without asking, for all members for which it leads to residuals that are finite."""
        trial, promised = self._evaluate(change), self._promised
        merits = trial.merits.tolist()
        takes = [number for number in self._active if math.isfinite(merits[number])]
        for number in takes:
            fall = self._state.courses[number].merit - merits[number]
            self.gains[number] = fall / promised[number] if promised[number] > 0.0 else -math.inf
        self._take(_Tried(trial, change, range(len(merits)), merits, promised), takes, takes)

    def _take(self, tried: _Tried, takes: list[int], rows: list[int]) -> None:
        """The members that take what was tried, and their places in it."""
        for number, row in zip(takes, rows, strict=True):
            self.merits[number], self.taken[number] = tried.merits[row], True
            self.halvings[number] = tried.halvings
        if len(takes) == len(self.merits):
            self._best, self._change = tried.trial, tried.change
        elif takes:
            chosen = torch.zeros(len(self.merits), dtype=torch.bool)
            chosen[takes] = True
            spread = self._problem.layout.member_spread(chosen.to(tried.change.device))
            self._change = torch.where(spread, tried.change, self._change)
            flat = self._start + self._change
            self._best = with_members(self._problem.structure, self._best, flat, tried.trial, takes, rows)

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

    def best(self) -> Evaluation | None:
        """The state in which every member has its best candidate; None if no member moves."""
        return None if self._best is self._state.evaluation else self._best

    def _finite(self, change: Tensor, seen: Sequence[int]) -> _Tried | None:
        """What a step leads to; None if it is finite for no member.

        Where single elements are not finite, at the border of their domain, the step of their unknowns is halved, so
        that they do not stop all others.
        """
        structure, system, promised = self._problem.structure, self._proposal.system, self._promised
        if len(self.merits) == 1 and are_many(self._problem.layout.num_unknowns):
            return self._unspoilt(change)
        whole = change
        every = range(len(self.merits))
        if len(seen) < len(every):
            trial = self._evaluate(change, seen)
            merits = trial.merits.tolist()
            if all(map(math.isfinite, merits)):
                return _Tried(trial, change, seen, merits, promised)
        for _ in range(_HALVINGS):
            trial = self._evaluate(change)
            merits = trial.merits.tolist()
            if all(map(math.isfinite, merits)):
                tried = _Tried(trial, change, every, merits, promised)
                return tried if any(fall > 0.0 for fall in promised) else self._shorter(whole) or tried
            change = torch.where(structure.unknowns_of_infinite_elements(trial), 0.5 * change, change)
            promised = system.predicted_fall(change).tolist()
        lost = [not math.isfinite(merit) for merit in merits]
        if all(lost):
            return self._shorter(whole)
        # Those that are nowhere finite stay where they are; they must not stop the other members.
        stay = torch.tensor(lost, device=change.device)
        change = torch.where(self._problem.layout.member_spread(stay), 0.0, change)
        trial, promised = self._evaluate(change), system.predicted_fall(change).tolist()
        return _Tried(trial, change, every, trial.merits.tolist(), promised)

    def _unspoilt(self, whole: Tensor) -> _Tried | None:
        """What the step of a large problem leads to, with that of unknowns halved whose elements spoil it."""
        attempts, change, left = self._attempts, whole, _HALVINGS
        while left:
            with self._watch.part("merit"):
                trial = attempts.evaluated(self._at(change))
                if isinstance(trial, Evaluation):
                    return self._of_large(trial, change, whole)
                spoilt: Spoilt | None = trial
                while spoilt is not None and left:
                    change, left = torch.where(spoilt.unknowns, 0.5 * change, change), left - 1
                    spoilt = attempts.spoilt(self._at(change), spoilt.terms)
        return self._of_large(self._evaluate(change), change, whole)

    @cached_property
    def _attempts(self) -> Attempts:
        return Attempts(self._state.evaluation, self._proposal)

    def _of_large(self, trial: Evaluation, change: Tensor, whole: Tensor) -> _Tried | None:
        """What it leads to; the whole step, shortened evenly, where it is not finite or, as the first, not downhill."""
        promised = self._promised if change is whole else self._proposal.system.predicted_fall(change).tolist()
        merits = trial.merits.tolist()
        if not math.isfinite(merits[0]):
            return self._shorter(whole)
        if promised[0] > 0.0:
            return _Tried(trial, change, range(1), merits, promised)
        # Steps longer than the model's are never downhill in the model: they count by what the step was to gain.
        tried = _Tried(trial, change, range(1), merits, self._promised)
        return tried if self.taken[0] else self._shorter(whole) or tried

    def _shorter(self, change: Tensor) -> _Tried | None:
        """What a step leads to that is shortened as a whole until all members are finite; None if none is.

        Where elements are of very different sizes, a step in which some parts are held back is not downhill any more.
        Shortened evenly it always is, and that costs no solve.
        """
        for number in range(1, _HALVINGS + 1):
            change = 0.5 * change
            trial = self._evaluate(change)
            merits = trial.merits.tolist()
            if all(map(math.isfinite, merits)):
                promised = self._proposal.system.predicted_fall(change).tolist()
                return _Tried(trial, change, range(len(merits)), merits, promised, number)
        return None

    def _admits(self, trial: State) -> bool:
        return self._guard is None or self._guard(self._state.evaluation.state, trial)

    def _at(self, change: Tensor) -> State:
        return self._problem.layout.unflatten(self._start + change)

    def _evaluate(self, change: Tensor, seen: Sequence[int] | None = None) -> Evaluation:
        structure = self._problem.structure
        with self._watch.part("merit"):
            if seen is None:
                return structure.evaluate(self._at(change))
            return structure.evaluate_members(self._start + change, list(seen))


class _Tried(NamedTuple):
    """A state tried, the step to it, numbers, merits and promised falls of members, and halvings of the whole step."""

    trial: Evaluation
    change: Tensor
    seen: Sequence[int]
    merits: list[float]
    promised: list[float]
    halvings: int = 0
