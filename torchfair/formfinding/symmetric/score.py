"""How far a mesh is from what the design of principal-symmetric meshes asks for."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from ...constraints.saddle_sides import beyond_tangent_plane, is_negative
from ...stars import pyramid_self_intersections
from .measures import condition_residuals
from .problem import SymmetricProblem


class Score(NamedTuple):
    """The smaller the better, residuals first.

    Attributes:
        residual: Largest relative residual of the conditions, not below the tolerance.
        wrong: Stars of negative curvature with principal neighbours on the wrong side, or with a crossing pyramid.
        missed: The larger share by which a bound of the shape that is kept is exceeded.
    """

    residual: float
    wrong: int
    missed: float = 0.0


def score(vertices: Tensor, problem: SymmetricProblem) -> Score:
    """Of normalised vertices (V, 3)."""
    residual = largest_residual(vertices, problem)
    missed = max(problem.missed(vertices))
    return Score(max(residual, problem.settings.tolerance), _count_wrong(vertices, problem), missed)


def largest_residual(vertices: Tensor, problem: SymmetricProblem) -> float:
    """Largest relative residual of the conditions at vertices (V, 3)."""
    residuals = condition_residuals(vertices, problem.principal, problem.stars)
    return max(float(values.max()) for values in residuals.values() if values.numel())


def _count_wrong(vertices: Tensor, problem: SymmetricProblem) -> int:
    if not problem.sides.count_wrong(vertices):
        return 0  # saddle-shaped stars of this kind have simple pyramids
    x = vertices[problem.sides.stencil]
    crossing = pyramid_self_intersections(vertices, problem.topology)[problem.stars.vertices] > 0
    return int((is_negative(x) & (crossing | ~beyond_tangent_plane(x))).sum())
