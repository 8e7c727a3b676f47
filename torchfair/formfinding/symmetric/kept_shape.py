"""The shape that a principal-symmetric mesh starts with, where nothing asks it to become another."""

from __future__ import annotations

import torch
from torch import Tensor

from ... import constraints as c
from ...boundary import boundary_corners
from ...geometry import ReferenceSurface
from ...projection import ElementTerm
from ...subdivision.interpolation import BOUNDARY_CORNER
from ...topology import Topology
from ..boundary_curves import BoundaryCurves


class KeptShape:
    """Closeness to a mesh itself, with its boundary gliding on smooth curves through it and its corners in place.

    Args:
        vertices: (V, 3) of the mesh, in the unit of the problem.
        topology: Its connectivity.
    """

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        self._planes = c.TangentPlanes(ReferenceSurface(vertices, topology))
        self._inside = torch.nonzero(~topology.is_boundary_vertex).squeeze(1)
        rim = BoundaryCurves.through(vertices, topology, boundary_corners(vertices, topology, BOUNDARY_CORNER))
        self._corners = torch.nonzero(rim.corners).squeeze(1)
        self._places, self._feet = vertices[self._corners], rim.feet()

    def terms(self, *, weight: float) -> list[ElementTerm]:
        """Half the squared distances of vertices from the surface, from their curves and from their corners."""
        terms = c.closeness_terms(self._planes, self._inside, weight=weight)
        if self._feet is not None:
            terms += c.gliding_terms(self._feet, weight=weight)
        if self._corners.numel():
            terms += c.handle_terms(self._corners, self._places, weight=weight, name="corners")
        return terms
