"""Live steps that lower C while handles are dragged, and how the surface comes to rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from torch import Tensor

from ...projection.layout import State
from ..face_guard import FaceGuard
from ..job.plan import Stage, Stages
from .cones import cone_weights
from .plan import FormPlan
from .problem import FormProblem
from .stages import in_space

_SHARES = (1.0, 0.5, 0.25)  # of the way on which vertices follow handles, until no face is crushed
_LEAST_ANGLE = math.radians(1.0)  # far handles need slender triangles: larger ones would hold them back


class FormFollower:
    """Steps in space, with smoothing and fairness as they were where following began.

    What surrounds handles is moved along with them first: a step alone would raise a spike, since flat stars want to
    stay flat. Fairness is as strong as while smoothing is coarse, and no step leads to angles below one degree or below
    the smallest there is.

    Args:
        problem: Terms and fixed vertices.
    """

    def __init__(self, problem: FormProblem) -> None:
        self._problem = problem
        self._base: Tensor | None = None  # where following began
        self._cones: tuple[int, Tensor] | None = None  # version of the pulls, and weights
        self._begun = 0

    def stage(self, state: State) -> Stage:
        """What the next step lowers."""
        problem, vertices = self._problem, state["vertices"]
        if self._base is None:
            self._base, self._begun = vertices, self._begun + 1
        base, settings = self._base, problem.settings
        own = replace(settings.projection, least_extrapolation=math.inf)  # longer ones overshoot
        return replace(
            in_space(problem, vertices, settings.smoothing, own),
            terms=lambda: problem.terms(
                base, problem.smoothing(base, settings.smoothing), settings.coarse_fairness_weight
            ),
            version=("live", self._begun, problem.pulls.version),
            guard=self._guard(vertices),
        )

    def predicted(self, state: State) -> State:
        """The state with handles where they are pulled, and cones around them."""
        problem, vertices = self._problem, state["vertices"]
        handles = problem.pulls.vertices
        way = problem.pulls.aims[handles] - vertices[handles]
        if not bool((way != 0.0).any()):
            return state
        moves, guard = self._weights(vertices) @ way, self._guard(vertices)
        for share in _SHARES:
            trial = {**state, "vertices": vertices + share * moves}
            if guard(state, trial):
                return trial
        return state

    def forget(self) -> None:
        """Following begins anew."""
        self._base = self._cones = None

    def snapshot(self) -> Callable[[], None]:
        """A function that puts back what is remembered."""
        remembered = self._base, self._cones, self._begun

        def put_back() -> None:
            self._base, self._cones, self._begun = remembered

        return put_back

    def _weights(self, vertices: Tensor) -> Tensor:
        problem, version = self._problem, self._problem.pulls.version
        if self._cones is None or self._cones[0] != version:
            stays = problem.fixed | problem.topology.is_boundary_vertex
            self._cones = version, cone_weights(vertices, problem.topology, problem.pulls.vertices, stays)
        return self._cones[1]

    def _guard(self, vertices: Tensor) -> FaceGuard:
        problem = self._problem
        least = min(_LEAST_ANGLE, problem.settings.least_angle, problem.smallest_angle(vertices))
        return FaceGuard(problem.topology, lambda state: state["vertices"], least, problem.steepest(vertices))


class SettlingPlan(FormPlan):
    """From where the surface is, with the last smoothing, and the whole job from its start: the better surface is kept.

    What was dragged may rest in a surface of higher C than there is: many minima lie next to each other. So what is
    found is no worse than what the whole job finds, whatever the way of the handles was. The whole job is left out
    where vertices are held away from where they started.

    Args:
        problem: Of one level.
        state: Where the surface is.
        start: (V, 3) where the job starts.
        nearby: Whether that is near the solution.
    """

    def __init__(self, problem: FormProblem, state: State, start: Tensor, *, nearby: bool) -> None:
        super().__init__(problem, {"vertices": start}, nearby=nearby)
        self.state = state
        self._found: State | None = None

    def stages(self) -> Stages:
        """Both."""
        problem = self._problem
        problem.pulls.aim(1.0, self._start)
        if problem.settings.formulation == "reduced":
            yield from self._from_nearby()
        else:
            yield from self._in_space([problem.settings.smoothing])
        yield from self._tangent_planes()
        away = (self.state["vertices"] != self._start).any(1)
        if not bool((away & problem.pulls.held).any()):
            self._found, self.state = self.state, {"vertices": self._start}
            yield from super().stages()

    def best(self) -> State:
        """That with the lower C, as far as handles are where they are pulled."""
        state = super().best()
        if self._found is None:
            return state
        found, other = (self._problem.curvature_and_pulls(one["vertices"]) for one in (self._found, state))
        return state if other < found else self._found
