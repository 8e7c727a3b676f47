"""Smooth curves through the boundary of a mesh, which its refinements share."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from ..boundary import boundary_pieces
from ..constraints.gliding import CurveFeet
from ..geometry.spline_curves import SplineCurves
from ..subdivision import Refinement
from ..topology import Topology


class BoundaryCurves(NamedTuple):
    """One curve for every piece of the boundary, and which vertex of a mesh is on which.

    Attributes:
        points: For every curve the (n, 3) points that it passes through.
        closed: Whether it is closed.
        owners: (V,) number of the curve of a boundary vertex between corners; -1 at other vertices.
        corners: (V,) bool, boundary vertices at which curves end.
    """

    points: list[Tensor]
    closed: list[bool]
    owners: Tensor
    corners: Tensor

    @classmethod
    def through(cls, vertices: Tensor, topology: Topology, corners: Tensor) -> BoundaryCurves:
        """Through the boundary vertices of a mesh (V, 3) itself, with its corners (V,)."""
        pieces = boundary_pieces(topology, corners)
        points = [vertices[piece.vertices] for piece in pieces]
        return cls(points, [piece.closed for piece in pieces], _owners(topology, corners), corners)

    def splines(self) -> SplineCurves | None:
        """The curves; None where there is no vertex between corners."""
        return SplineCurves(self.points, self.closed) if bool((self.owners >= 0).any()) else None

    def feet(self) -> CurveFeet | None:
        """Closest points on their curves of all vertices between corners; None where there is no such vertex."""
        curves, rows = self.splines(), torch.nonzero(self.owners >= 0).squeeze(1)
        return None if curves is None else CurveFeet(curves, rows, self.owners[rows])

    def mapped(self, function: Callable[[Tensor], Tensor]) -> BoundaryCurves:
        """In another unit."""
        return self._replace(points=[function(points) for points in self.points])

    def refined(self, step: Refinement) -> BoundaryCurves:
        """The same curves for a finer mesh; boundary loops keep their order, and corners are no more than before."""
        corners = step.carry_vertex_labels(self.corners)
        return self._replace(owners=_owners(step.topology, corners), corners=corners)

    def nearest(self, vertices: Tensor, chosen: Tensor) -> Tensor:
        """The vertices (V, 3), those ``chosen`` (V,) bool among those of curves on their curves."""
        rows = torch.nonzero(chosen & (self.owners >= 0)).squeeze(1)
        curves = self.splines()
        if curves is None or not rows.numel():
            return vertices
        return vertices.index_copy(0, rows, curves.closest(vertices[rows], self.owners[rows]).positions)


def _owners(topology: Topology, corners: Tensor) -> Tensor:
    owners = torch.full((topology.num_vertices,), -1)
    for number, piece in enumerate(boundary_pieces(topology, corners)):
        owners[piece.vertices] = number
    owners[corners] = -1  # they belong to two, but do not glide
    return owners
