"""When the job that lowers E solves its steps by conjugate gradients, though factors would fit."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ...projection import ProjectionSettings

if TYPE_CHECKING:
    from .problem import FairProblem

_FEWEST = 10_000  # vertices, from which on exact steps take most of the time and get no further


def with_solver(settings: ProjectionSettings, problem: FairProblem) -> ProjectionSettings:
    """The settings of a stage, with conjugate gradients where those leave the choice open and they are faster.

    A stage of many steps needs none of them exactly. Factors stay where planarity, flat edges, handles or auxiliary
    variables weigh thousands of times what E does, and on other polygons than triangles, which were not measured.

    Args:
        settings: Of the stage; another solver than ``"auto"`` stays.
        problem: What it solves.
    """
    if settings.solver != "auto" or not _suits(problem):
        return settings
    return replace(settings, solver="cg")


def _suits(problem: FairProblem) -> bool:
    """Whether a triangle mesh is large, and nothing but E, fairness, closeness and barriers is asked for."""
    panels, settings, topology = problem.panels, problem.settings, problem.topology
    stiff = panels.corners.numel() > 0 or settings.formulation != "reduced" or settings.projection.takes_every_step
    large = topology.is_triangular and topology.num_vertices >= _FEWEST
    return large and not stiff and not bool(problem.pulls.pulled.any())
