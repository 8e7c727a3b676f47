"""Boundary vertices and the curves they lie on, kept together while the mesh is refined."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ...curves import ClosedCurve
from ...errors import MeshError
from ...subdivision import Refinement
from ...topology import Topology


class BoundaryTrack:
    """Every boundary loop lies on a closed curve; every boundary vertex has a parameter on it.

    Attributes:
        topology: Of the mesh.
        curves: One for each boundary loop, in their order.
        parameters: (V,) on the curve of the vertex; 0 inside.
        curve_numbers: (V,) number of the curve, -1 inside.
        corners: (V,) bool, vertices at corners of their curve.
    """

    def __init__(self, topology: Topology, curves: Sequence[ClosedCurve], parameters: Tensor, corners: Tensor) -> None:
        self.topology, self.curves = topology, list(curves)
        self.parameters, self.corners = parameters, corners
        self.curve_numbers = torch.full((topology.num_vertices,), -1, dtype=torch.int64)
        for number, loop in enumerate(topology.boundary_loops()):
            self.curve_numbers[loop] = number

    @classmethod
    def through(cls, vertices: Tensor, topology: Topology, corner_angle: float) -> BoundaryTrack:
        """Curves through the boundary vertices themselves."""
        loops = topology.boundary_loops()
        curves = [ClosedCurve(vertices[loop], corner_angle=corner_angle) for loop in loops]
        parameters = vertices.new_zeros(topology.num_vertices, dtype=torch.float64)
        corners = torch.zeros(topology.num_vertices, dtype=torch.bool)
        for loop, curve in zip(loops, curves, strict=True):
            parameters[loop] = curve.knots
            corners[loop] = torch.isin(curve.knots, curve.corners)
        return cls(topology, curves, parameters, corners)

    @classmethod
    def onto(cls, vertices: Tensor, topology: Topology, curves: Sequence[ClosedCurve]) -> BoundaryTrack:
        """Given curves; each loop takes the nearest one, its vertices the nearest places, corners the corners.

        Raises:
            MeshError: there are not as many curves as boundary loops, or two loops have the same nearest curve.
        """
        loops = topology.boundary_loops()
        if len(loops) != len(curves):
            raise MeshError(f"the mesh has {len(loops)} boundary loops, but {len(curves)} curves were given")
        parameters = torch.zeros(topology.num_vertices, dtype=torch.float64)
        corners = torch.zeros(topology.num_vertices, dtype=torch.bool)
        chosen = []
        for loop in loops:
            points = vertices[loop]
            places = [curve.parameters_of(points) for curve in curves]
            gaps = [float((curve.at(s) - points).norm(dim=1).sum()) for curve, s in zip(curves, places, strict=True)]
            best = min(range(len(curves)), key=gaps.__getitem__)
            chosen.append(best)
            parameters[loop] = places[best]
            for corner in curves[best].corners:
                nearest = loop[_gap(parameters[loop], corner).argmin()]
                parameters[nearest], corners[nearest] = corner, True
        if len(set(chosen)) < len(chosen):
            raise MeshError("two boundary loops are nearest to the same curve: give a mesh that starts nearer to them")
        return cls(topology, [curves[i] for i in chosen], parameters, corners)

    def positions(self, vertices: Tensor) -> Tensor:
        """The vertices (V, 3) with those on the boundary put in their places on the curves."""
        moved = vertices.clone()
        for number, curve in enumerate(self.curves):
            mine = self.curve_numbers == number
            moved[mine] = curve.at(self.parameters[mine]).to(moved)
        return moved

    def updated(self, vertices: Tensor) -> BoundaryTrack:
        """The same curves with the parameters of vertices that have slid along them."""
        parameters = self.parameters.clone()
        for number, curve in enumerate(self.curves):
            mine = (self.curve_numbers == number) & ~self.corners
            parameters[mine] = curve.parameters_of(vertices[mine])
        return BoundaryTrack(self.topology, self.curves, parameters, self.corners)

    def refined(self, refinement: Refinement) -> BoundaryTrack:
        """New boundary vertices lie in the middle of their edge, by arc length."""
        coarse = self.topology
        start, end = self.parameters[coarse.boundary_edges].unbind(1)
        there = torch.remainder(end - start + 0.5, 1.0) - 0.5  # either way round, the short one
        parameters = refinement.carry_vertex_labels(self.parameters)
        parameters[new_boundary_vertices(refinement)] = torch.remainder(start + 0.5 * there, 1.0)
        return BoundaryTrack(refinement.topology, self.curves, parameters, refinement.carry_vertex_labels(self.corners))

    def renumbered(self, topology: Topology, numbers: Tensor) -> BoundaryTrack:
        """On another mesh with the same boundary, whose vertices have the ``numbers`` (V,) there; -1 inside."""
        old = torch.nonzero(self.curve_numbers >= 0).squeeze(1)
        there = numbers[old]
        curve_numbers, parameters, corners = (
            known.new_zeros(topology.num_vertices).index_put((there,), known[old])
            for known in (self.curve_numbers, self.parameters, self.corners)
        )
        curves = [self.curves[int(curve_numbers[loop[0]])] for loop in topology.boundary_loops()]
        return BoundaryTrack(topology, curves, parameters, corners)

    def spans(self, vertices: Tensor) -> Tensor:
        """(n,) number of the span that boundary ``vertices`` (n,) lie on, among those of all curves in a row."""
        first, result = 0, torch.zeros_like(vertices)
        for number, curve in enumerate(self.curves):
            mine = self.curve_numbers[vertices] == number
            stops = curve.corners
            place = torch.searchsorted(stops, self.parameters[vertices[mine]].contiguous(), right=True) - 1
            result[mine] = first + (torch.remainder(place, len(stops)) if len(stops) else torch.zeros_like(place))
            first += max(1, len(stops))
        return result


def new_boundary_vertices(refinement: Refinement) -> slice:
    """Numbers of the vertices of one refinement step that stem from boundary edges, in the order of these."""
    coarse = refinement.coarse
    return slice(coarse.num_vertices + coarse.num_interior_edges, coarse.num_vertices + coarse.num_edges)


def _gap(parameters: Tensor, other: Tensor) -> Tensor:
    """Distance of parameters on a circle of length 1."""
    return (torch.remainder(parameters - other + 0.5, 1.0) - 0.5).abs()
