"""C is lowered from several starts, and the best surface kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from torch import Tensor

from ...energies import normal_variation, total_absolute_curvature
from ...measuring import fold_measures
from ...projection.layout import State
from ..job.plan import Plan, Stages
from ..job.promises import HANDLE_REACHED
from .follower import FormFollower
from .measures import fold_promises, folded_faces
from .other_starts import Start
from .plan import FormPlan
from .problem import FormProblem

_BETTER = 1e-3  # relative: by less no other surface is taken than the one found before
FAR = 1.0  # mean edge lengths: a handle that is farther away is dragged, too
_LONGEST_DRAG = 0.5  # mean edge lengths in one move
_MOST_DRAGS = 40
_STEPS = 3  # after each move
_SLIVERS, _FOLDED = 1, 2  # grades of surfaces, or that handles are missed: better none


class DraggedPlan(FormPlan):
    """Handles are moved to their targets in small steps, which the surface follows; then it comes to rest.

    A whole job pulls at once, and what it finds may fold around far handles where a surface that follows does not.
    """

    def stages(self) -> Stages:
        """The job with handles where they are, moves of all of them with a few steps each, and the last smoothing."""
        problem, pulls = self._problem, self._problem.pulls
        follower = FormFollower(problem)
        start = self._start
        pulls.aim(0.0, start)
        yield from self._from_afar()
        moves = min(_MOST_DRAGS, max(1, math.ceil(pulls.farthest(start) / _LONGEST_DRAG)))
        for move in range(1, moves + 1):
            pulls.aim(move / moves, start)
            stage = follower.stage(follower.predicted(self.state))
            own = replace(stage.settings, max_iterations=_STEPS, when_settled="stop")
            yield replace(stage, settings=own, version=object())
        pulls.aim(1.0, start)
        yield from self._from_nearby()
        yield from self._tangent_planes()


class SeveralStarts(Plan):
    """One plan after the other; kept is the surface of least C that has no folds and reaches its handles.

    Args:
        problem: Of one level.
        starts: Where to start from, the first one as given.
        report: Told at the end what was found.

    Attributes:
        found: C of every start that was tried, by name.
    """

    def __init__(self, problem: FormProblem, starts: list[Start], report: Callable[[str], None]) -> None:
        super().__init__({"vertices": starts[0].vertices})
        self._problem, self._starts, self._report = problem, starts, report
        self._plan: Plan | None = None
        self._kept: tuple[int, float, str, State] | None = None
        self.found: list[tuple[str, float]] = []

    def stages(self) -> Stages:
        """Those of all plans."""
        for start in self._starts:
            yield from self._carried_out(start.name, FormPlan(self._problem, _state(start), nearby=False))
        pulls, first = self._problem.pulls, self._starts[0]
        if pulls.farthest(first.vertices) > FAR:
            yield from self._carried_out("handles dragged", DraggedPlan(self._problem, _state(first), nearby=True))
        self._say()

    def best(self) -> State:
        """The best of those that are finished, or where someone stopped the first one."""
        if self._plan is not None and self._kept is None:
            return self._plan.best()
        return self.state if self._kept is None else self._kept[3]

    def _carried_out(self, name: str, plan: Plan) -> Stages:
        self.state, self._plan = plan.state, plan
        stages = plan.stages()
        stage = next(stages, None)
        while stage is not None:
            run = yield stage
            plan.state = self.state
            try:
                stage = stages.send(run)
            except StopIteration:
                break
        self._compare(name, plan.best())

    def _compare(self, name: str, state: State) -> None:
        problem, vertices = self._problem, state["vertices"]
        grade, fault = self._grade(vertices)
        worth = problem.curvature_and_pulls(vertices)
        if grade:  # C means little there
            worth += float(normal_variation(vertices, problem.topology))
        curvature = problem.length * float(total_absolute_curvature(vertices, problem.topology))
        self.found.append((name + fault, curvature))
        kept = self._kept
        if kept is None or (grade, worth) < (kept[0], kept[1] * (1.0 - _BETTER)):
            self._kept = grade, worth, name, state

    def _grade(self, vertices: Tensor) -> tuple[int, str]:
        problem = self._problem
        if problem.pulls.farthest(vertices) > HANDLE_REACHED:
            return _FOLDED, " (misses handles)"
        if not all(promise.holds for promise in fold_promises(fold_measures(vertices, problem.topology))):
            return _FOLDED, " (folded)"
        if folded_faces(vertices, problem.topology):
            return _FOLDED, " (folded)"
        if problem.has_collapsed(vertices, self._starts[0].vertices):
            return _SLIVERS, " (slivers)"
        return 0, ""

    def _say(self) -> None:
        if len(self.found) > 1 and self._kept is not None:
            listed = ", ".join(f"{name} {value:.5g}" for name, value in self.found)
            self._report(f"C from {len(self.found)} starts: {listed}; kept: {self._kept[2]}")


def _state(start: Start) -> State:
    return {"vertices": start.vertices}
