"""How far a mesh is from planar faces, and what it may cost to make them planar."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from .face_planes import on_face_planes
from .panels import PLANAR_PROMISE

if TYPE_CHECKING:
    from .problem import FairProblem

_LARGEST_MEAN_WARP = 0.05  # relative planarity: of 47 meshes that became planar none had more than 0.02

KEEP_LIMIT = ": planar_distance 0 to keep that"
"""How a note ends that says that planar faces lie beyond the distance limit: what settings can do."""


class PlanarityGoal:
    """Planar faces as a goal of the job that lowers E: whether meshes reach it, and within which limits.

    Meshes are given as (V, 3) vertices, of which gliding ones are put in place here.

    Args:
        problem: Terms and guards of the job.

    Attributes:
        most_warped: Relative planarity that no face may exceed that should be planar but cannot become so.
        distance: How far planar faces may take the mesh from the reference, in mean edges of the input.
    """

    def __init__(self, problem: FairProblem) -> None:
        self._problem = problem
        self.most_warped, self.distance = math.inf, 0.0

    def snapshot(self) -> Callable[[], None]:
        """A function that puts back what they have cost."""
        cost = self.most_warped, self.distance

        def put_back() -> None:
            self.most_warped, self.distance = cost

        return put_back

    def warps(self, vertices: Tensor) -> Tensor:
        """(n,) relative planarity of the faces kept planar."""
        problem = self._problem
        return problem.panels.warps(problem.placed({"vertices": vertices}))

    def largest_warp(self, vertices: Tensor) -> float:
        """Largest relative planarity of the faces kept planar; 0 where there are none."""
        warps = self.warps(vertices)
        return float(warps.max()) if warps.numel() else 0.0

    def is_reached(self, vertices: Tensor) -> bool:
        """Whether faces are planar as promised."""
        return self.largest_warp(vertices) <= PLANAR_PROMISE

    def is_reached_within_limits(self, vertices: Tensor) -> bool:
        """Whether faces are planar as promised, within the limits of the start."""
        return self.is_reached(vertices) and not self._leaves_limits(vertices)

    def is_far(self, vertices: Tensor) -> bool:
        """Whether faces that are to be planar would, in the mean, take corners beyond the distance limit.

        Along the normal each corner of a quad has to go half of the distance between its diagonals. Not where handles
        pull, which have to go on step by step.
        """
        problem = self._problem
        limit = problem.settings.distance_limit
        if limit is None or not problem.panels.makes_planar or problem.pulls.pulled.any():
            return False
        return float(self.warps(vertices).mean()) > max(2.0 * limit, _LARGEST_MEAN_WARP)

    def where_planes_meet(self, vertices: Tensor) -> Tensor | None:
        """A start (V, 3) nearer to planar faces, far off within the tangent planes; None if it breaks bounds."""
        problem = self._problem
        stay = problem.stays() | problem.pulls.pulled | problem.pulls.held
        moved = torch.where(stay[:, None], vertices, on_face_planes(vertices, problem.topology, problem.panels.planar))
        state, trial = {"vertices": vertices}, {"vertices": moved}
        if torch.equal(moved, vertices) or not problem.keeps_faces(state, trial):
            return None
        return None if not problem.settings.planar_distance and self._leaves_limits(moved) else moved

    def takes(self, vertices: Tensor) -> None:
        """Takes in what the best ``vertices`` with planar faces cost: distance from the reference, and E."""
        problem = self._problem
        problem.has_other_goals = True
        problem.near.put_back()
        limits, distances = problem.near.limits, problem.near.distances(problem.placed({"vertices": vertices}))
        if limits is None or not bool((distances > limits).any()):
            return
        problem.near.lift(vertices)
        self.distance = problem.settings.planar_distance
        farthest = float(distances[distances > limits].max()) / problem.input_edge
        problem.notes.append(
            f"planar faces take the mesh {farthest:.3g} mean edge lengths from the reference surface, beyond the "
            f"distance limit{KEEP_LIMIT}"
        )

    def _leaves_limits(self, vertices: Tensor) -> bool:
        problem = self._problem
        limits, placed = problem.near.limits, problem.placed({"vertices": vertices})
        return limits is not None and bool((problem.near.distances(placed) > limits).any())
