"""Runs of guided projection that lower C: along normals, where shape is found, and in space, where vertices spread."""

from __future__ import annotations

from dataclasses import replace

from torch import Tensor

from ...projection import ProjectionSettings
from ...projection.layout import State
from ...settings.form_settings import FormSettings
from ..face_guard import FaceGuard
from ..job.plan import Stage
from .problem import FormProblem

_ROUGHLY, _THOROUGHLY = 10.0, 0.1  # tolerances of stages along normals, over those in space


def along_normals(
    problem: FormProblem, base: Tensor, fraction: float, fairness_weight: float, *, correct: bool = False
) -> Stage:
    """A run in which the vertices ``base`` (V, 3) move along normals: a third of the unknowns, little to go wrong.

    Args:
        problem: Terms and fixed vertices.
        base: Where they start.
        fraction: Smoothing, see :meth:`FormProblem.smoothing`.
        fairness_weight: Weight of fairness.
        correct: Whether tangent planes are met as exactly as patches at the boundary tell, which are frozen here.
    """
    directions = problem.directions(base)

    def place(state: State) -> Tensor:
        return base + state["heights"] * directions

    return Stage(
        name="heights, correct" if correct else "heights",
        blocks={"heights": base.new_zeros(base.shape[0], 1)},
        terms=lambda: problem.height_terms(
            base, directions, problem.smoothing(base, fraction), fairness_weight, correct=correct
        ),
        version=object(),
        settings=_along_normals_settings(problem.settings, fraction),
        fixed={"heights": problem.topology.is_boundary_vertex | problem.fixed},
        guard=FaceGuard(problem.topology, place, steepest=problem.steepest(base)),
        result=lambda state: {"vertices": place(state)},
        anew=correct,  # patches may fit at other vertices than before
    )


def in_space(problem: FormProblem, vertices: Tensor, fraction: float, settings: ProjectionSettings) -> Stage:
    """A run in which vertices (V, 3) move in all directions, next to prescribed tangent planes along normals only."""
    return Stage(
        name="vertices",
        blocks=problem.blocks(vertices),
        terms=lambda: problem.terms(vertices, problem.smoothing(vertices, fraction)),
        version=object(),
        settings=settings,
        fixed={"vertices": problem.fixed_in_space},
        guard=FaceGuard(problem.topology, _places, problem.least_angle(vertices), problem.steepest(vertices)),
        result=lambda state: {"vertices": state["vertices"]},
    )


def _places(state: State) -> Tensor:
    return state["vertices"]


def _along_normals_settings(settings: FormSettings, fraction: float) -> ProjectionSettings:
    """Rough where a finer smoothing follows, thorough with the last one, where steps are cheap and safe."""
    own = settings.projection
    if fraction > settings.smoothing:
        return replace(own, merit_tolerance=_ROUGHLY * own.merit_tolerance, patience=1, when_settled="stop")
    return replace(own, merit_tolerance=_THOROUGHLY * own.merit_tolerance, when_settled="stop")
