"""Boundary and creases of a mesh that glide on smooth curves through its own vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from ...projection.layout import State
from ..boundary_curves import BoundaryCurves
from ..job.pulls import Pulls


class GlidingBoundary:
    """Smooth curves along boundary and creases of a mesh, and the vertices that glide on them.

    Corners and handles do not glide. In the mesh of a state gliding vertices are put on their curves exactly; a term
    that weighs their distance leaves them beside, by a thousandth of an edge or less.

    Args:
        held: (V,) bool, vertices that glide and corners that stay: the curves hold them, not the surface.
        rim: The curves, and which vertex is on which.
        pulls: Vertices that are pulled elsewhere do not glide meanwhile.
        loose: (n,) vertices of faces that are kept planar, which asks for more digits than that: in the mesh of a state
            they are where the state has them.

    Attributes:
        held: As given.
        feet: Closest points of gliding vertices on their curves; None where nothing glides.
    """

    def __init__(self, held: Tensor, rim: BoundaryCurves, pulls: Pulls, loose: Tensor) -> None:
        self._pulls, self.held = pulls, held
        chosen = torch.nonzero(rim.owners >= 0).squeeze(1)
        self._loose = torch.isin(chosen, loose)[:, None]
        self.feet = rim.feet()

    def placed(self, state: State) -> Tensor:
        """The vertices (V, 3) of a state with those that glide put on their curves."""
        if self.feet is None:
            return state["vertices"]
        points, chosen = state[self.feet.block], self.feet.vertices
        places = torch.where(self._loose | ~self.glides[:, None], points[chosen], self.feet(state).positions)
        return points.index_copy(0, chosen, places)

    @property
    def glides(self) -> Tensor:
        """(n,) bool, those of the vertices on curves that glide now: neither pulled nor held."""
        none = self.held.new_zeros(0)
        return none if self.feet is None else ~(self._pulls.pulled | self._pulls.held)[self.feet.vertices]

    def distances(self, vertices: Tensor) -> Tensor:
        """(n,) distances of gliding vertices from their curves, for vertices (V, 3) of a mesh."""
        if self.feet is None:
            return vertices.new_zeros(0)
        return self.feet({self.feet.block: vertices}).distances[self.glides]

    def nearest(self, state: State, positions: Tensor, normals: Tensor) -> tuple[Tensor, Tensor]:
        """Closest points (V, 3) and unit normals (V, 3) of a surface, or those of curves where they are nearer.

        As on the surface, the normal at a curve points to the vertex.
        """
        if self.feet is None:
            return positions, normals
        found, chosen = self.feet(state), self.feet.vertices
        points = state[self.feet.block][chosen]
        nearer = self.glides[:, None] & (
            found.distances[:, None] < torch.linalg.vector_norm(points - positions[chosen], dim=1, keepdim=True)
        )
        away = (points - found.positions) / found.distances.clamp_min(1e-300)[:, None]
        towards = torch.where(nearer & (found.distances[:, None] > 1e-9), away, normals[chosen])
        places = torch.where(nearer, found.positions, positions[chosen])
        return positions.index_copy(0, chosen, places), normals.index_copy(0, chosen, towards)
