"""A module for every ready-made constraint, made for a mesh, and what is known about it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from term_cases import lattice, mixed, moved, smooth, triangles
from torch import Tensor

from torchfair import Topology
from torchfair import constraints as c
from torchfair.boundary import boundary_corners, boundary_pieces
from torchfair.geometry import ReferenceSurface, SplineCurves, corner_angles, edge_lengths, face_areas, vertex_normals
from torchfair.principal import PrincipalStars
from torchfair.projection import ElementTerm

CPU = torch.device("cpu")


@dataclass(frozen=True)
class Case:
    """A constraint and its laws.

    Attributes:
        make: From vertices and what else the shape has, the module.
        terms: The same from the function that returns terms.
        shape: Vertices, topology and, of lattices, edges and stars.
        power: With which power of the scale the value grows if all data are scaled along.
        refreshed: Whether data follow the state: second derivatives leave that out.
        twice: Whether second derivatives exist.
    """

    make: Callable[..., c.Constraint]
    terms: Callable[..., list[ElementTerm]]
    shape: Callable[[torch.device], tuple] = triangles
    power: int = 2
    refreshed: bool = False
    twice: bool = True

    def mesh(self) -> tuple:
        return self.shape(CPU)

    def module(self) -> c.Constraint:
        return self.make(*self.mesh())

    def vertices(self) -> Tensor:
        """Where the module is tried: not where it was made."""
        return moved(self.mesh()[0])


def size(vertices: Tensor, topology: Topology) -> float:
    return 0.1 * float(edge_lengths(vertices, topology).mean())


def rim(topology: Topology) -> Tensor:
    return torch.nonzero(topology.is_boundary_vertex).squeeze(1)


def saddles(topology: Topology) -> Tensor:
    return ~topology.is_boundary_vertex & (topology.valences >= 4)


def normals_at(vertices: Tensor, topology: Topology) -> Tensor:
    """Where they are prescribed, somewhat turned."""
    return vertex_normals(moved(vertices), topology) * topology.is_boundary_vertex[:, None]


def curves(vertices: Tensor, topology: Topology) -> tuple[SplineCurves, Tensor, Tensor]:
    pieces = boundary_pieces(topology, boundary_corners(vertices, topology, math.radians(40)))
    owners = torch.cat([torch.full_like(piece.vertices, number) for number, piece in enumerate(pieces)])
    splines = SplineCurves([vertices[piece.vertices] for piece in pieces], [piece.closed for piece in pieces])
    return splines, torch.cat([piece.vertices for piece in pieces]), owners


def limits(vertices: Tensor, topology: Topology) -> Tensor:
    """Between which the largest distance is nearly reached."""
    away = float((moved(vertices) - vertices).norm(dim=1).max())
    return torch.full_like(vertices[:, 0], 1.05 * away)


def decided(vertices: Tensor, stars: PrincipalStars) -> list[ElementTerm]:
    sides = c.SaddleSides(stars)
    sides.decide(vertices)
    return sides.terms(weight=1.0)


def some(topology: Topology) -> Tensor:
    return torch.arange(0, topology.num_vertices, 2)


def planes(vertices: Tensor, topology: Topology) -> c.TangentPlanes:
    return c.TangentPlanes(ReferenceSurface(vertices, topology))


def polygons(topology: Topology) -> Tensor:
    return torch.arange(topology.num_faces)


def tilted(vertices: Tensor, topology: Topology) -> Tensor:
    return normals_at(vertices, topology)[rim(topology)]


CASES: dict[str, Case] = {
    "boundary bending": Case(
        lambda v, t: c.BoundaryBending(t, normals_at(v, t), smoothing=size(v, t)),
        lambda v, t: c.boundary_bending_terms(t, normals_at(v, t), smoothing=size(v, t)),
        power=1,
    ),
    "boundary fairness": Case(
        lambda v, t: c.BoundaryFairness(t, boundary_corners(v, t, 1.0)),
        lambda v, t: c.boundary_fairness_terms(t, boundary_corners(v, t, 1.0), weight=1.0),
        mixed,
    ),
    "closeness": Case(
        lambda v, t: c.Closeness(ReferenceSurface(v, t), some(t)),
        lambda v, t: c.closeness_terms(planes(v, t), some(t), weight=1.0),
        mixed,
        refreshed=True,
    ),
    "coplanar": Case(
        lambda v, t, edges, stars: c.Coplanar(edges, stars),
        lambda v, t, edges, stars: c.eliminated_principal_symmetric_terms(edges, stars, weight=1.0)[1:],
        lattice,
    ),
    "corner angles": Case(
        lambda v, t: c.CornerAngles(t, 0.01, 1.5 * corner_angles(v, t)),
        lambda v, t: c.corner_angle_terms(t, 0.01, 1.5 * corner_angles(v, t), weight=1.0),
        mixed,
        power=0,
    ),
    "cospherical": Case(
        lambda v, t, edges, stars: c.Cospherical(stars),
        lambda v, t, edges, stars: c.eliminated_principal_symmetric_terms(edges, stars, weight=1.0)[:1],
        lattice,
    ),
    "displacement fairness": Case(
        lambda v, t: c.DisplacementFairness(v, t), lambda v, t: c.displacement_fairness_terms(v, t, weight=1.0), mixed
    ),
    "distance limit": Case(
        lambda v, t: c.DistanceLimit(ReferenceSurface(v, t), limits(v, t)),
        lambda v, t: c.distance_limit_terms(planes(v, t), limits(v, t), weight=1.0),
        power=0,
        refreshed=True,
    ),
    "even fairness": Case(
        lambda v, t: c.EvenFairness(v, t), lambda v, t: c.even_fairness_terms(v, t, weight=1.0), mixed
    ),
    "even stars": Case(
        lambda v, t, edges, stars: c.EvenStars(stars),
        lambda v, t, edges, stars: c.even_star_terms(stars, weight=1.0),
        lattice,
        power=0,
    ),
    "face areas": Case(
        lambda v, t: c.FaceAreas(t, 2.5 * face_areas(v, t), smallest=0.1),
        lambda v, t: c.face_area_terms(t, 2.5 * face_areas(v, t), smallest=0.1, weight=1.0),
        mixed,
        power=0,
    ),
    "flat edges": Case(
        lambda v, t: c.FlatEdges(t, torch.arange(0, t.num_interior_edges, 2)),
        lambda v, t: c.flat_edge_terms(t, torch.arange(0, t.num_interior_edges, 2), weight=1.0),
        mixed,
    ),
    "edge directions": Case(
        lambda v, t: c.EdgeDirections(v, t),
        lambda v, t: c.edge_direction_terms(v, t, torch.arange(t.num_interior_edges), weight=1.0),
        mixed,
    ),
    "gliding": Case(
        lambda v, t: c.Gliding(*curves(v, t)),
        lambda v, t: c.gliding_terms(c.CurveFeet(*curves(v, t)), weight=1.0),
        refreshed=True,
    ),
    "good saddles": Case(
        lambda v, t: c.GoodSaddles(v, t, saddles(t), margin=0.01),
        lambda v, t: c.saddle_terms(v, t, saddles(t), margin=0.01, weight=1.0),
        power=0,
        refreshed=True,
    ),
    "handles": Case(
        lambda v, t: c.Handles(some(t), v[some(t)]), lambda v, t: c.handle_terms(some(t), v[some(t)], weight=1.0)
    ),
    "interior fairness": Case(
        lambda v, t: c.InteriorFairness(t), lambda v, t: c.interior_fairness_terms(t, weight=1.0), mixed
    ),
    "planarity": Case(lambda v, t: c.Planarity(t), lambda v, t: c.planarity_terms(t, polygons(t), weight=1.0), mixed),
    "pyramids": Case(lambda v, t: c.NormalPyramids(t), lambda v, t: c.pyramid_terms(t, weight=1.0), power=0),
    "saddle shape": Case(
        lambda v, t, edges, stars: c.SaddleShape(stars, moved(v)),
        lambda v, t, edges, stars: decided(moved(v), stars),
        lattice,
        power=0,
    ),
    "smooth absolute curvature": Case(
        lambda v, t: c.SmoothAbsoluteCurvature(t, smoothing=size(v, t)),
        lambda v, t: c.absolute_curvature_terms(t, smoothing=size(v, t)),
        power=1,
    ),
    "smooth normal variation": Case(
        lambda v, t: c.SmoothNormalVariation(t, smoothing=size(v, t)),
        lambda v, t: c.normal_variation_terms(t, smoothing=size(v, t)),
        mixed,
        power=1,
    ),
    "straight fairness": Case(
        lambda v, t: c.StraightFairness(t), lambda v, t: c.polyline_fairness_terms(t, weight=1.0), mixed
    ),
    "tangent patches": Case(
        lambda v, t: c.TangentPatches(v, t, rim(t), tilted(v, t)),
        lambda v, t: c.tangent_patch_terms(v, t, rim(t), tilted(v, t), weight=1.0),
        smooth,
        power=0,
    ),
    "tangent stars": Case(
        lambda v, t: c.TangentStars(t, rim(t), tilted(v, t)),
        lambda v, t: c.tangent_plane_terms(t, rim(t), tilted(v, t), weight=1.0),
        power=0,
    ),
    "tangential fairness": Case(
        lambda v, t: c.TangentialFairness(t), lambda v, t: c.tangential_fairness_terms(t, weight=1.0), mixed
    ),
}
