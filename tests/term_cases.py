"""A small problem for every ready-made term, set up on any device: states, and terms made there."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import torch
from geometry_meshes import mixed_grid
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair import constraints as c
from torchfair.boundary import boundary_corners, boundary_pieces
from torchfair.geometry import corner_angles, face_areas, vertex_normals
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.geometry.spline_curves import SplineCurves
from torchfair.principal import PrincipalStars, principal_edges_of_lattice
from torchfair.projection import ElementTerm
from torchfair.projection.layout import State
from torchfair.shapes import Catenoid, principal_triangles

Mesh = tuple[Tensor, Topology]
Lattice = tuple[Tensor, Topology, Tensor, PrincipalStars]
Terms = list[ElementTerm]
Case = tuple[State, Terms]

CASES: dict[str, Callable[[torch.device], list[Case]]] = {}
"""By name of the function or method that makes the terms."""


def triangles(device: torch.device) -> Mesh:
    """In generic position, with boundary."""
    vertices, topology = wavy_grid(5, 5, triangles=True)
    return vertices.to(device), topology.to(device)


def mixed(device: torch.device) -> Mesh:
    """Triangles, quads and a hexagon."""
    vertices, topology = mixed_grid()
    return vertices.to(device), topology.to(device)


def smooth(device: torch.device) -> Mesh:
    """A quadratic height field."""
    vertices, topology = wavy_grid(5, 5, triangles=True)
    vertices[:, 2] = 0.02 * vertices[:, 0] ** 2 - 0.03 * vertices[:, 0] * vertices[:, 1]
    return vertices.to(device), topology.to(device)


def lattice(device: torch.device) -> Lattice:
    """A disturbed principal lattice, its edges between stars, and its stars."""
    mesh = principal_triangles(Catenoid(), 6, 8, ends="zigzag")
    noise = 0.05 * torch.randn(mesh.vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    principal = principal_edges_of_lattice(mesh, "u").to(device)
    stars = principal.stars()
    edges = c.between_stars(principal.topology.edges[principal.mask], stars)
    return (mesh.vertices + noise).to(device), principal.topology, edges, stars


def rim(topology: Topology) -> Tensor:
    return torch.nonzero(topology.is_boundary_vertex).squeeze(1)


def moved(vertices: Tensor) -> Tensor:
    return vertices + 0.05 * (3.0 * vertices).sin().roll(1, 1)


def case(name: str, *shapes: Callable[[torch.device], Any]) -> Callable[[Callable[..., Terms | Case]], None]:
    """Registers a function from what ``shapes`` return, vertices first, to terms, or to blocks and terms."""

    def register(make: Callable[..., Terms | Case]) -> None:
        def build(device: torch.device) -> list[Case]:
            cases = []
            for shape in shapes:
                vertices, *others = shape(device)
                made = make(vertices, *others)
                cases.append(made if isinstance(made, tuple) else ({"vertices": vertices}, made))
            return cases

        CASES[name] = build

    return register


case("absolute_curvature_terms", triangles)(lambda v, t: c.absolute_curvature_terms(t, smoothing=0.1))
case("corner_angle_terms", triangles, mixed)(
    lambda v, t: c.corner_angle_terms(t, 0.01, 1.5 * corner_angles(v, t), weight=1.0)
)
case("eliminated_principal_symmetric_terms", lattice)(
    lambda v, t, edges, stars: c.eliminated_principal_symmetric_terms(edges, stars, weight=2.0)
)
case("even_fairness_terms", triangles)(lambda v, t: c.even_fairness_terms(v, t, weight=0.5))
case("even_star_terms", lattice)(lambda v, t, edges, stars: c.even_star_terms(stars, weight=0.5))
case("face_area_terms", triangles, mixed)(lambda v, t: c.face_area_terms(t, 2.5 * face_areas(v, t), weight=0.5))
case("interior_fairness_terms", triangles, mixed)(lambda v, t: c.interior_fairness_terms(t, weight=0.5))
case("normal_variation_terms", triangles, mixed)(lambda v, t: c.normal_variation_terms(t, smoothing=0.1))
case("polyline_fairness_terms", triangles, mixed)(lambda v, t: c.polyline_fairness_terms(t, weight=0.5))
case("pyramid_terms", triangles, mixed)(lambda v, t: c.pyramid_terms(t, weight=0.5))


@case("along_directions", triangles)
def _(vertices: Tensor, topology: Topology) -> Case:
    terms = [*c.absolute_curvature_terms(topology, smoothing=0.1), *c.interior_fairness_terms(topology, weight=2.0)]
    heights = 0.1 * vertices[:, :1].sin()
    return {"heights": heights}, [c.along_directions(term, vertices, vertices.roll(1, 1)) for term in terms]


@case("boundary_bending_terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Terms:
    normals = vertex_normals(vertices, topology) * topology.is_boundary_vertex[:, None]
    return c.boundary_bending_terms(topology, normals, smoothing=0.1)


@case("boundary_fairness_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Terms:
    return c.boundary_fairness_terms(topology, boundary_corners(vertices, topology, math.radians(40)), weight=0.5)


@case("closeness_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Case:
    planes = c.TangentPlanes(ReferenceSurface(vertices, topology))
    chosen = torch.nonzero(topology.valences > 3).squeeze(1)
    return {"vertices": moved(vertices)}, c.closeness_terms(planes, chosen, weight=0.5)


@case("Constraint.terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Case:
    """Modules made on the CPU and moved, with everything that is refreshed."""
    here, there = triangles(torch.device("cpu")), vertices.device
    reference, chosen = ReferenceSurface(*here), torch.arange(0, 25, 2)
    curves = SplineCurves([here[0][:5]], [False])
    modules = [
        c.Closeness(reference, chosen),
        c.DistanceLimit(reference, torch.full_like(here[0][:, 0], 0.1)),
        c.Gliding(curves, torch.arange(5), torch.zeros(5, dtype=torch.int64)),
        c.GoodSaddles(*here, ~here[1].is_boundary_vertex & (here[1].valences >= 4), margin=0.01),
        c.Handles(chosen, moved(here[0])[chosen]),
    ]
    terms = [term for module in modules for term in module.to(there).terms(weight=0.5)]
    return {"vertices": moved(vertices)}, terms


@case("flat_edge_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Terms:
    chosen = torch.arange(0, topology.num_interior_edges, 2, device=vertices.device)
    return c.flat_edge_terms(topology, chosen, weight=0.5)


@case("edge_direction_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Terms:
    chosen = torch.arange(0, topology.num_interior_edges, 2, device=vertices.device)
    return c.edge_direction_terms(vertices, topology, chosen, weight=0.5)


@case("coplanar_terms", lattice)
def _(vertices: Tensor, topology: Topology, edges: Tensor, stars: PrincipalStars) -> Case:
    return {"vertices": vertices, **c.sphere_blocks(vertices, stars)}, c.coplanar_terms(edges, stars, weight=2.0)


@case("cospherical_terms", lattice)
def _(vertices: Tensor, topology: Topology, edges: Tensor, stars: PrincipalStars) -> Case:
    return {"vertices": moved(vertices), **c.sphere_blocks(vertices, stars)}, c.cospherical_terms(stars, weight=2.0)


@case("displacement_fairness_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Case:
    return {"vertices": moved(vertices)}, c.displacement_fairness_terms(vertices, topology, weight=0.5)


@case("distance_limit_terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Case:
    planes = c.TangentPlanes(ReferenceSurface(vertices, topology))
    state = {"vertices": moved(vertices)}
    return state, c.distance_limit_terms(planes, torch.full_like(vertices[:, 0], 0.1), weight=0.5)


@case("gliding_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Case:
    pieces = boundary_pieces(topology, boundary_corners(vertices, topology, math.radians(40)))
    curves = SplineCurves([vertices[piece.vertices] for piece in pieces], [piece.closed for piece in pieces])
    owners = torch.cat([torch.full_like(piece.vertices, number) for number, piece in enumerate(pieces)])
    gliding = torch.cat([piece.vertices for piece in pieces])
    return {"vertices": moved(vertices)}, c.gliding_terms(c.CurveFeet(curves, gliding, owners), weight=0.5)


@case("handle_terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Terms:
    chosen = rim(topology)
    return c.handle_terms(chosen, moved(vertices)[chosen], weight=0.5)


@case("lifted_absolute_curvature_terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Case:
    blocks = c.lifted_absolute_curvature_blocks(vertices.cpu(), topology.to("cpu"))  # signs of eigenvectors are open
    blocks = {"vertices": moved(vertices), **{name: block.to(vertices) for name, block in blocks.items()}}
    return blocks, c.lifted_absolute_curvature_terms(topology, smoothing=0.1)


@case("lifted_normal_variation_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Case:
    planar = topology.face_sizes == 3
    terms = c.lifted_normal_variation_terms(vertices, topology, planar, weight=0.5, constraint_weight=10.0)
    return {"vertices": moved(vertices), **c.lifted_normal_variation_blocks(vertices, topology)}, terms


@case("lifted_flat_edge_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Case:
    chosen = torch.arange(0, topology.num_interior_edges, 2, device=vertices.device)
    return {
        "vertices": moved(vertices),
        **c.lifted_normal_variation_blocks(vertices, topology),
    }, c.lifted_flat_edge_terms(topology, chosen, weight=2.0)


@case("lifted_principal_symmetric_terms", lattice)
def _(vertices: Tensor, topology: Topology, edges: Tensor, stars: PrincipalStars) -> Case:
    is_saddle = torch.ones_like(stars.vertices, dtype=torch.bool)
    terms = c.lifted_principal_symmetric_terms(edges, stars, is_saddle, weight=2.0)
    return {"vertices": moved(vertices), **c.lifted_principal_symmetric_blocks(vertices, edges, stars)}, terms


@case("planarity_terms", mixed)
def _(vertices: Tensor, topology: Topology) -> Terms:
    return c.planarity_terms(topology, torch.nonzero(topology.face_sizes > 3).squeeze(1), weight=0.5)


@case("saddle_terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Case:
    saddles = ~topology.is_boundary_vertex & (topology.valences >= 4)
    return {"vertices": moved(vertices)}, c.saddle_terms(vertices, topology, saddles, weight=0.5, margin=0.01)


@case("SaddleSides.terms", lattice)
def _(vertices: Tensor, topology: Topology, edges: Tensor, stars: PrincipalStars) -> Terms:
    sides = c.SaddleSides(stars)
    sides.reconsider(vertices)
    sides.decide(vertices)
    sides.reconsider(moved(vertices))
    sides.decide(moved(vertices))
    fresh = c.SaddleSides(stars)  # decides at the first state
    return [*sides.terms(weight=2.0), *sides.terms(weight=2.0, ahead=False), *fresh.terms(weight=1.0)]


@case("tangent_patch_terms", smooth, triangles)
def _(vertices: Tensor, topology: Topology) -> Case:
    chosen = rim(topology)
    normals = vertex_normals(vertices, topology)[chosen]
    normals[::3] = normals[::3].roll(1, 1)  # far from the surface: these stars are turned instead
    return {"vertices": moved(vertices)}, c.tangent_patch_terms(vertices, topology, chosen, normals, weight=0.5)


@case("tangent_plane_terms", triangles)
def _(vertices: Tensor, topology: Topology) -> Terms:
    chosen = rim(topology)
    targets = c.BoundaryNormals.of(vertices, topology).star_targets(vertex_normals(vertices, topology))[chosen]
    return c.tangent_plane_terms(topology, chosen, targets, weight=0.5)


@case("tangential_fairness_terms", triangles, mixed)
def _(vertices: Tensor, topology: Topology) -> Case:
    return {"vertices": moved(vertices)}, c.tangential_fairness_terms(topology, weight=0.5)
