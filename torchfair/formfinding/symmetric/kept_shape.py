"""The shape that a principal-symmetric mesh starts with, where nothing asks it to become another."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor

from ... import constraints as c
from ...boundary import boundary_corners
from ...energies import normal_variation, total_absolute_curvature
from ...geometry import ReferenceSurface, edge_lengths
from ...projection import ElementTerm
from ...subdivision.interpolation import BOUNDARY_CORNER
from ...topology import Topology
from ..boundary_curves import BoundaryCurves

LARGEST_DISTANCE = 0.1
"""Of a vertex from the surface, in mean edges."""
MORE_ENERGY = 1.01
"""E/C over that of the mesh itself."""


class Missed(NamedTuple):
    """By what shares the bounds of a shape that is kept are exceeded; 0 where they hold.

    Attributes:
        distance: Beyond ``LARGEST_DISTANCE``.
        energy: Beyond ``MORE_ENERGY``; 0 for flat meshes, which have no E/C.
    """

    distance: float = 0.0
    energy: float = 0.0


class KeptShape:
    """Closeness to a mesh itself, with its boundary gliding on smooth curves through it and its corners in place.

    Args:
        vertices: (V, 3) of the mesh, in the unit of the problem.
        topology: Its connectivity.
    """

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        self._vertices, self._topology = vertices, topology
        self._surface = ReferenceSurface(vertices, topology)
        self._planes = c.TangentPlanes(self._surface)
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

    def missed(self, vertices: Tensor) -> Missed:
        """How far vertices (V, 3) are from what is promised of them."""
        away = float(self._surface.closest(vertices).distances.max() / self._edge)
        more = self._energy_over_curvature(vertices) / self._at_start
        return Missed(
            max(0.0, away / LARGEST_DISTANCE - 1.0), max(0.0, more / MORE_ENERGY - 1.0) if more > 0.0 else 0.0
        )

    @cached_property
    def _edge(self) -> float:
        return float(edge_lengths(self._vertices, self._topology).mean())

    @cached_property
    def _at_start(self) -> float:
        return self._energy_over_curvature(self._vertices)

    def _energy_over_curvature(self, vertices: Tensor) -> float:
        curvature = float(total_absolute_curvature(vertices, self._topology))
        return float(normal_variation(vertices, self._topology)) / curvature if curvature > 0.0 else math.nan
