"""How a principal-symmetric mesh is found: a shape, then conditions and saddle sides to rounding; again if it fails."""

from __future__ import annotations

import math
from dataclasses import replace

from ...projection import ProjectionSettings
from ...projection.layout import State
from ..job.plan import Plan, Stages, going_on
from .problem import Aim, SymmetricProblem
from .score import Score, largest_residual, score

_EXACT = ProjectionSettings(
    max_iterations=25,
    initial_damping=1e-4,
    damping_scale="identity",
    merit_tolerance=1e-2,
    when_settled="stop",
    step_tolerance=1e-12,
    least_extrapolation=math.inf,
)
_NEAR = replace(_EXACT, initial_damping=1e-6, step_tolerance=3e-11)  # where conditions nearly hold
_TIGHT_STEPS = 5
_PORTION_STEPS = 6
_LONGEST_PULL = 3.0  # mean edge lengths that handles are pulled at once
_MOST_PORTIONS = 12
_FAR = 1.5  # mean edge lengths that handles are away, from which on many stars may have to turn into others
_PULLED = 0.1  # mean edge lengths from which on handles may be to blame where conditions cannot be met
_MORE_MARGIN = 1.6  # from round to round
_PATIENT_ROUNDS = 2  # before stars that stay wrong are to be something else
_LESS_PULL = 0.2
_SLIDING = 0.1  # of fairness of the displacement, which keeps lattices from turning into the directions
_MORE_WEIGHT = 2.0  # of closeness or E from round to round, where the shape is kept
_MOST_WEIGHT = 32.0
_FEW = 0.01  # share of stars with wrong sides that a wider margin may mend


class SymmetricPlan(Plan):
    """Rounds until conditions and saddle sides are right; a start that is, with handles in place, is only made exact.

    Where conditions cannot be met, the next round begins at the start again with handles that pull less: they yield. A
    few saddle sides that come out wrong are tried again with a wider margin. Where the shape is kept and has come too
    far from its start, or E/C has risen, the next rounds weigh that more. The best state found is kept.

    Args:
        problem: Terms and guards.
        state: Where it starts.
        rounds: At most so many.
    """

    def __init__(self, problem: SymmetricProblem, state: State, rounds: int) -> None:
        super().__init__(state)
        self._problem, self._rounds = problem, rounds
        self._best: tuple[Score, State] | None = None
        self._steps_left = problem.settings.most_steps
        self._unscored = False

    def stages(self) -> Stages:
        """Round after round."""
        problem = self._problem
        problem.pull_fully()
        if not problem.has_other_goals and self._farthest() <= problem.settings.tolerance and self._is_right():
            yield from self._run(Aim.CONDITIONS, _EXACT)
            return
        start, pulled = self.state, self._farthest() > _PULLED
        problem.sides.margin = problem.settings.saddle_margin
        problem.sides.forget()
        problem.rigidity = problem.stiffness = problem.smoothness = 1.0
        for attempt in range(self._rounds):
            self._unscored = True
            yield from self._round(first=attempt == 0)
            found = self._note_score()
            if self._is_right(found) or not self._steps_left:
                return
            if found[:2] == (problem.settings.tolerance, 0):
                if not self._rebalance():
                    return
                continue
            many = attempt > 0 and found.wrong > _FEW * problem.stars.vertices.shape[0]
            if pulled and (many or found.residual > problem.settings.tolerance):
                self.state = start
                problem.pulls.strength *= _LESS_PULL
            else:
                problem.sides.margin *= _MORE_MARGIN
                if attempt >= _PATIENT_ROUNDS:
                    problem.sides.reconsider(self.state["vertices"])

    def best(self) -> State:
        """The state of the best score, that of a round cut short among them; handles pull as they did."""
        if self._unscored:
            self._note_score()
        self._problem.pull_fully()
        return self.state if self._best is None else self._best[1]

    # ---- one round ---------------------------------------------------------------------------------------

    def _round(self, *, first: bool) -> Stages:
        """A shape, the same with tighter conditions, conditions and saddle sides alone.

        Where both cannot be met together, conditions are met alone.
        """
        shape = self._problem.settings.projection
        if self._farthest() > _FAR:
            yield from self._approach()
            self._decide()
            yield from self._run(Aim.SEARCH, shape)
        self._decide()
        yield from self._run(Aim.SHAPE, shape)
        if first and self._decide():
            yield from self._run(Aim.SHAPE, shape)
        yield from self._finish(shape, _EXACT)

    def _finish(self, tight: ProjectionSettings, exact: ProjectionSettings) -> Stages:
        """From the shape on."""
        yield from self._run(Aim.TIGHT, replace(tight, max_iterations=_TIGHT_STEPS))
        yield from self._run(Aim.EXACT, exact)
        if largest_residual(self.state["vertices"], self._problem) > self._problem.settings.tolerance:
            yield from self._run(Aim.CONDITIONS, _EXACT)

    def _approach(self) -> Stages:
        """Pulls handles most of the way in portions, where they are far from their targets."""
        problem, start = self._problem, self.state["vertices"]
        search = replace(problem.settings.projection, max_iterations=_PORTION_STEPS)
        portions = math.ceil(self._farthest() / _LONGEST_PULL)
        for portion in range(1, min(portions, _MOST_PORTIONS)):
            problem.pulls.aim(portion / portions, start)
            self._decide()
            yield from self._run(Aim.SEARCH, search)
        problem.pulls.aim(1.0, start)

    def _decide(self) -> int:
        return self._problem.sides.decide(self.state["vertices"])

    def _run(self, aim: Aim, settings: ProjectionSettings) -> Stages:
        if self._steps_left:
            most = min(settings.max_iterations, self._steps_left)
            run = yield self._problem.stage(self.state, aim, replace(settings, max_iterations=most))
            self._steps_left -= run.iterations

    # ---- judgement ---------------------------------------------------------------------------------------

    def _farthest(self) -> float:
        """Largest distance of a handle from its target."""
        return self._problem.pulls.farthest(self.state["vertices"])

    def _is_right(self, found: Score | None = None) -> bool:
        return (found or self._score()) == (self._problem.settings.tolerance, 0, 0.0)

    def _rebalance(self) -> bool:
        """Lets vertices slide, then weighs more what was missed of the shape; False where all that has been tried."""
        problem, missed = self._problem, self._problem.missed(self.state["vertices"])
        if problem.rigidity == 1.0:
            problem.rigidity = _SLIDING
            return True
        if missed.distance > 0.0:
            problem.stiffness *= _MORE_WEIGHT
        if missed.energy > 0.0:
            problem.smoothness *= _MORE_WEIGHT
        return max(problem.stiffness, problem.smoothness) <= _MOST_WEIGHT

    def _score(self) -> Score:
        return score(self.state["vertices"], self._problem)

    def _note_score(self) -> Score:
        """The score of the state, which is remembered if it is the best so far."""
        found = self._score()
        if self._best is None or found < self._best[0]:
            self._best = (found, self.state)
        self._unscored = False
        return found


class SettlingPlan(SymmetricPlan):
    """For a mesh that has followed its handles: the first round begins with tighter conditions, unless they are far.

    Args:
        problem, state, rounds: See the base class.
        damping: Where the first run goes on.
    """

    def __init__(self, problem: SymmetricProblem, state: State, rounds: int, damping: float | None) -> None:
        super().__init__(problem, state, rounds)
        self._damping = damping

    def _round(self, *, first: bool) -> Stages:
        if not first or self._farthest() > _PULLED:
            yield from super()._round(first=first)
            return
        self._decide()
        yield from self._finish(going_on(self._problem.settings.projection, self._damping), _NEAR)
