"""The shape that a principal-symmetric mesh starts with, where nothing asks it to become another."""

from __future__ import annotations

import torch
from torch import Tensor

from ... import constraints as c
from ...boundary import boundary_corners, boundary_pieces
from ...constraints.gliding import CurveFeet
from ...geometry import ReferenceSurface
from ...geometry.spline_curves import SplineCurves
from ...projection import ElementTerm
from ...subdivision.interpolation import BOUNDARY_CORNER
from ...topology import Topology


class KeptShape:
    """Closeness to a mesh itself, with its boundary gliding on smooth curves through it and its corners in place.

    Args:
        vertices: (V, 3) of the mesh, in the unit of the problem.
        topology: Its connectivity.
    """

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        self._vertices, self._topology = vertices, topology
        self._planes = c.TangentPlanes(ReferenceSurface(vertices, topology))
        corners = boundary_corners(vertices, topology, BOUNDARY_CORNER)
        self._corners = torch.nonzero(corners).squeeze(1)
        self._gliding = torch.nonzero(topology.is_boundary_vertex & ~corners).squeeze(1)
        self._feet = self._curve_feet(corners) if self._gliding.numel() else None

    def _curve_feet(self, corners: Tensor) -> CurveFeet:
        pieces = boundary_pieces(self._topology, corners)
        curves = SplineCurves([self._vertices[piece.vertices] for piece in pieces], [piece.closed for piece in pieces])
        owners = torch.full((self._topology.num_vertices,), -1)
        for number, piece in enumerate(pieces):
            owners[piece.vertices] = number  # corners belong to two, but do not glide
        return CurveFeet(curves, self._gliding, owners[self._gliding])

    def terms(self, *, weight: float) -> list[ElementTerm]:
        """Half the squared distances of vertices from the surface, from their curves and from their corners."""
        inside = torch.nonzero(~self._topology.is_boundary_vertex).squeeze(1)
        terms = c.closeness_terms(self._planes, inside, weight=weight)
        if self._feet is not None:
            terms += c.gliding_terms(self._feet, weight=weight)
        if self._corners.numel():
            terms += c.handle_terms(self._corners, self._vertices[self._corners], weight=weight, name="corners")
        return terms
