"""How C is lowered on one level: shape first, then the places of vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...projection.layout import State
from ..job.plan import Plan, Stages
from .problem import FormProblem
from .stages import along_normals, in_space

_TANGENT_ROUNDS = 3


class FormPlan(Plan):
    """From any start, or from one near the solution.

    With decreasing smoothing the vertices first move along their normals, which are anew those of the surface in each
    stage. Then they move in space with the last smoothings, which spreads them.

    Coarse smoothing leads a long way, but it blurs what distinguishes a slender tube from a waisted one. So where that
    has not converged or has collapsed, the last smoothing is tried from the start too, and the better surface taken.

    Args:
        problem: Of one level.
        state: Where it starts.
        nearby: Whether that is near the solution, such as the refinement of one: then with the last smoothing only.
    """

    def __init__(self, problem: FormProblem, state: State, *, nearby: bool) -> None:
        super().__init__(state)
        self._problem, self._start, self._nearby = problem, state["vertices"], nearby
        self._rival: State | None = None  # what was found from coarse smoothings, while another is tried

    def stages(self) -> Stages:
        """Along normals, in space, and along normals once more where tangent planes are prescribed."""
        problem, settings = self._problem, self._problem.settings
        problem.pulls.aim(1.0, self._start)
        if settings.formulation == "lifted":
            smoothings = list(dict.fromkeys(settings.smoothings()))  # coarse and fine may be the same
            yield from self._in_space(smoothings[-1:] if self._nearby else smoothings)
        elif self._nearby:
            yield from self._from_nearby()
        else:
            yield from self._from_afar()
        yield from self._tangent_planes()

    def best(self) -> State:
        """The last state, or that from coarse smoothings where the last one is not better."""
        return self._better_of_both()

    def _better_of_both(self) -> State:
        if self._rival is None or self._is_better(self.state, self._rival):
            return self.state
        return self._rival

    def _from_afar(self) -> Stages:
        problem, settings = self._problem, self._problem.settings
        *coarse, last = settings.smoothings()
        rests = []
        for fraction in coarse:
            run = yield along_normals(problem, self.state["vertices"], fraction, settings.coarse_fairness_weight)
            rests.append(run.status.at_rest)
        in_the_end = [coarse[-1], last]
        if self._is_doubtful(rests):
            fine = along_normals(problem, self._start, last, settings.fairness_weight)
            self._rival = self.state
            yield fine
            best, other = self._better_of_both(), self._rival
            self.state, self._rival = best, None
            if best is not other:
                in_the_end = [last]
        yield from self._in_space(in_the_end)

    def _from_nearby(self) -> Stages:
        problem, settings = self._problem, self._problem.settings
        yield along_normals(problem, self.state["vertices"], settings.smoothing, settings.fairness_weight)
        # Next to prescribed tangent planes, vertices that are already spread stay so: ridges would draw them in.
        if not problem.keeps_rows:
            yield from self._in_space([settings.smoothing])

    def _in_space(self, smoothings: Sequence[float]) -> Stages:
        own = self._problem.settings.projection
        *earlier, last = smoothings
        for fraction in earlier:
            yield in_space(self._problem, self.state["vertices"], fraction, replace(own, when_settled="stop"))
        yield in_space(self._problem, self.state["vertices"], last, own)

    def _tangent_planes(self) -> Stages:
        """Patches at the boundary are frozen in a run, so they are made anew some times."""
        problem, settings = self._problem, self._problem.settings
        for _ in range(_TANGENT_ROUNDS if problem.has_tangent_planes else 0):
            vertices = self.state["vertices"]
            yield along_normals(problem, vertices, settings.smoothing, settings.fairness_weight, correct=True)

    def _is_doubtful(self, rests: Sequence[bool]) -> bool:
        return not all(rests) or self._problem.has_collapsed(self.state["vertices"], self._start)

    def _is_better(self, state: State, other: State) -> bool:
        problem, surfaces = self._problem, (state["vertices"], other["vertices"])
        collapsed = [problem.has_collapsed(surface, self._start) for surface in surfaces]
        if collapsed[0] != collapsed[1]:
            return collapsed[1]
        smoothing = problem.smoothing(surfaces[1], problem.settings.smoothing)
        mine, theirs = (problem.merit(surface, smoothing) for surface in surfaces)
        return mine < theirs
