"""How a principal-symmetric mesh is found: a shape, then conditions and saddle sides to rounding; again if it fails."""

from __future__ import annotations

import math
from dataclasses import replace

import torch
from torch import Tensor

from ..._interrupts import deferred_interrupts
from ...constraints.saddle_sides import beyond_tangent_plane, is_negative
from ...principal import PrincipalEdges
from ...projection import Callback, ProjectionResult, ProjectionSettings
from ...projection.layout import State
from ...stars import pyramid_self_intersections
from ..stopping import interrupted, stopped
from .measures import condition_residuals
from .problem import Aim, SymmetricProblem

_EXACT = ProjectionSettings(
    max_iterations=25,
    initial_damping=1e-4,
    damping_scale="identity",
    merit_tolerance=1e-2,
    when_settled="stop",
    step_tolerance=1e-12,
    least_extrapolation=math.inf,
)
_TIGHT_STEPS = 5
_PORTION_STEPS = 6
_LONGEST_PULL = 3.0  # mean edge lengths that handles are pulled at once
_MOST_PORTIONS = 12
_FAR = 1.5  # mean edge lengths that handles are away, from which on many stars may have to turn into others
_PULLED = 0.1  # mean edge lengths from which on handles may be to blame where conditions cannot be met
_MORE_MARGIN = 1.6  # from round to round
_PATIENT_ROUNDS = 2  # before stars that stay wrong are to be something else
_LESS_PULL = 0.2
_FEW = 0.01  # share of stars with wrong sides that a wider margin may mend


class SymmetricRounds:
    """Rounds of one edit; make it, call :meth:`run` once.

    Args:
        problem: Terms and compiled runs.
        principal: Which edges are principal.
        state: Variable blocks to start from.
        callback: See :func:`~torchfair.projection.guided_projection`.

    Attributes:
        state: The best state found.
        runs: Every run of guided projection.
    """

    def __init__(
        self, problem: SymmetricProblem, principal: PrincipalEdges, state: State, callback: Callback | None
    ) -> None:
        self.problem, self.principal, self.settings = problem, principal, problem.settings
        self.state, self.callback = state, callback
        self.runs: list[ProjectionResult] = []
        self._best: tuple[tuple[float, int], State] | None = None

    def run(self, rounds: int, *, settled: bool) -> bool:
        """Runs round after round until conditions and saddle sides are right; whether it was stopped.

        Args:
            rounds: At most so many.
            settled: Whether a state that meets them, with handles at their targets, is all that is asked for.
        """
        with deferred_interrupts() as interrupts:
            try:
                return self._search(rounds, settled)
            except KeyboardInterrupt:  # between runs, which keep their own best state
                if not self.runs:
                    raise
                self.runs[-1] = interrupted(self.runs[-1])
                interrupts.insist(self._take_best)
                return True

    def _search(self, rounds: int, settled: bool) -> bool:
        if settled and self._farthest() <= self.settings.tolerance and self._is_right(self._score()):
            return self._run(Aim.CONDITIONS, _EXACT)
        start, pulled = self.state, self._farthest() > _PULLED
        problem = self.problem
        problem.sides.margin, problem.pull = self.settings.saddle_margin, 1.0
        problem.sides.forget()
        ended = False
        for attempt in range(rounds):
            ended = self._round(first=attempt == 0)
            score = self._note_score()
            if ended or self._is_right(score) or not self._steps_left():
                break
            many = attempt > 0 and score[1] > _FEW * problem.stars.vertices.shape[0]
            if pulled and (many or score[0] > self.settings.tolerance):
                self.state = start
                problem.pull *= _LESS_PULL
            else:
                problem.sides.margin *= _MORE_MARGIN
                if attempt >= _PATIENT_ROUNDS:
                    problem.sides.reconsider(self.state["vertices"])
        if self._best is not None:
            self.state = self._best[1]
        return ended

    def _note_score(self) -> tuple[float, int]:
        """The score of the state, which is remembered if it is the best so far."""
        score = self._score()
        if self._best is None or score < self._best[0]:
            self._best = (score, self.state)
        return score

    def _take_best(self) -> None:
        self._note_score()
        if self._best is not None:
            self.state = self._best[1]

    # ---- one round ---------------------------------------------------------------------------------------

    def _round(self, *, first: bool) -> bool:
        """A shape, the same with tighter conditions, conditions and saddle sides alone; whether it was stopped.

        Where both cannot be met together, conditions are met alone.
        """
        shape = self.settings.projection
        if self._farthest() > _FAR:
            if self._approach():
                return True
            self._decide()
            if self._run(Aim.SEARCH, shape):
                return True
        self._decide()
        if self._run(Aim.SHAPE, shape):
            return True
        if first and self._decide() and self._run(Aim.SHAPE, shape):
            return True
        tight = replace(shape, max_iterations=_TIGHT_STEPS)
        if self._run(Aim.TIGHT, tight) or self._run(Aim.EXACT, _EXACT):
            return True
        return self._largest_residual() > self.settings.tolerance and self._run(Aim.CONDITIONS, _EXACT)

    def _approach(self) -> bool:
        """Pulls handles most of the way in portions, where they are far from their targets."""
        start, end = self.state["vertices"][self.problem.handles], self.problem.targets
        portions = math.ceil(self._farthest() / _LONGEST_PULL)
        for portion in range(1, min(portions, _MOST_PORTIONS)):
            self.problem.targets = start.lerp(end, portion / portions)
            try:
                self._decide()
                ended = self._run(Aim.SEARCH, replace(self.settings.projection, max_iterations=_PORTION_STEPS))
            finally:
                self.problem.targets = end
            if ended:
                return True
        return False

    def _decide(self) -> int:
        return self.problem.sides.decide(self.state["vertices"])

    def _run(self, aim: Aim, settings: ProjectionSettings) -> bool:
        left = self._steps_left()
        if not left:
            return False
        run = self.problem.compiled(aim).solve(
            self.state,
            settings=replace(settings, max_iterations=min(settings.max_iterations, left)),
            callback=self.callback,
            guard=self.problem.admits,
        )
        self.runs.append(run)
        self.state = run.blocks
        return stopped(run)

    def _steps_left(self) -> int:
        return max(0, self.settings.most_steps - sum(run.iterations for run in self.runs))

    # ---- judgement ---------------------------------------------------------------------------------------

    def _farthest(self) -> float:
        """Largest distance of a handle from its target."""
        away = self.state["vertices"][self.problem.handles] - self.problem.targets
        return float(torch.linalg.vector_norm(away, dim=1).max()) if away.numel() else 0.0

    def _score(self) -> tuple[float, int]:
        """Largest relative residual, not below the tolerance, and how many saddle sides are wrong."""
        return max(self._largest_residual(), self.settings.tolerance), self._count_wrong(self.state["vertices"])

    def _largest_residual(self) -> float:
        residuals = condition_residuals(self.state["vertices"], self.principal, self.problem.stars)
        return max(float(values.max()) for values in residuals.values() if values.numel())

    def _is_right(self, score: tuple[float, int]) -> bool:
        return score == (self.settings.tolerance, 0)

    def _count_wrong(self, vertices: Tensor) -> int:
        """Stars of negative curvature with principal neighbours on the wrong side, or with a crossing pyramid."""
        problem = self.problem
        if not problem.sides.count_wrong(vertices):
            return 0  # saddle-shaped stars of this kind have simple pyramids
        x = vertices[problem.sides.stencil]
        crossing = pyramid_self_intersections(vertices, problem.topology)[problem.stars.vertices] > 0
        return int((is_negative(x) & (crossing | ~beyond_tangent_plane(x))).sum())
