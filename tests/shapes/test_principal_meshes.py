"""Quad and triangle meshes along parameter lines."""

from __future__ import annotations

import math

import pytest
import torch

from torchfair.errors import MeshError
from torchfair.geometry import corner_angles, dual_edge_lengths, edge_lengths, edge_vectors, face_areas, face_normals
from torchfair.shapes import (
    SURFACES,
    Catenoid,
    Cylinder,
    Enneper,
    FreeFormPatch,
    Hyperboloid,
    Paraboloid,
    PrincipalHelicoid,
    PrincipalParaboloid,
    Sphere,
    Torus,
    interior_absolute_curvature,
    parameter_quads,
    parameter_triangles,
    principal_quads,
    principal_triangles,
)

PRINCIPAL = [name for name, make in SURFACES.items() if make().parameter_lines_are_principal]
LATTICES = {
    "quads": principal_quads,
    "along u": principal_triangles,
    "along v": lambda s, r, c: principal_triangles(s, r, c, along="v"),
    "zigzag u": lambda s, r, c: principal_triangles(s, r, c, ends="zigzag"),
    "zigzag v": lambda s, r, c: principal_triangles(s, r, c, along="v", ends="zigzag"),
}


def energy(mesh):
    """E = sum of l l*, from its definition."""
    interior = mesh.topology.num_interior_edges
    lengths = edge_lengths(mesh.vertices, mesh.topology)[:interior]
    return float((lengths * dual_edge_lengths(mesh.vertices, mesh.topology)).sum())


def euler_characteristic(topology):
    return topology.num_vertices - topology.num_edges + topology.num_faces


@pytest.mark.parametrize("kind", LATTICES)
@pytest.mark.parametrize("name", PRINCIPAL)
def test_every_lattice_on_every_surface(name, kind):
    surface = SURFACES[name]()
    if kind == "zigzag v" and any(surface.poles):
        pytest.skip("refused: see test_errors")
    mesh = LATTICES[kind](surface, 8, 14)
    topology = mesh.topology
    torch.testing.assert_close(mesh.vertices, surface.position(*mesh.parameters.T))
    closed = all(surface.periodic) or all(surface.poles)
    assert len(topology.boundary_loops()) == (0 if closed else 2 if surface.periodic[0] else 1)
    assert euler_characteristic(topology) == (2 if all(surface.poles) else 0 if surface.periodic[0] else 1)
    assert topology.valences.min() >= 2
    facing = (face_normals(mesh.vertices, topology)[topology.corner_faces] * mesh.normals[topology.corners]).sum(-1)
    assert facing.min() > 0.4
    if not any(surface.poles):
        assert set(topology.valences[~topology.is_boundary_vertex].tolist()) == {4 if kind == "quads" else 6}


def test_counts():
    torus, patch = Torus(), Enneper()
    for mesh, vertices, faces in (
        (principal_quads(torus, 8, 10), 80, 80),
        (principal_quads(patch, 8, 10), 99, 80),
        (principal_quads(Sphere(), 8, 10), 72, 80),
        (principal_triangles(torus, 8, 10), 80, 160),
        (principal_triangles(patch, 4, 10), 3 * 11 + 2 * 12, 4 * 21),
        (principal_triangles(patch, 4, 10, along="v"), 6 * 5 + 5 * 6, 10 * 9),
        (principal_triangles(patch, 4, 10, ends="zigzag"), 3 * 11 + 2 * 10, 4 * 19),
        (principal_triangles(Sphere(), 6, 10), 52, 100),
    ):
        assert (mesh.topology.num_vertices, mesh.topology.num_faces) == (vertices, faces)


def test_straight_boundary_is_the_rectangle():
    for along in ("u", "v"):
        for make in (principal_quads, lambda s, r, c, along=along: principal_triangles(s, r, c, along=along)):
            mesh = make(PrincipalParaboloid(), 6, 7)
            ends = torch.tensor(mesh.surface.domain, dtype=torch.float64)
            on_boundary = (mesh.parameters[..., None] == ends).flatten(1).any(1)
            assert torch.equal(on_boundary, mesh.topology.is_boundary_vertex)


# ---- principal edges -----------------------------------------------------------------------------------


def deviation(mesh, direction):
    """Largest angle between an edge marked as principal and the nearest principal direction at its first end."""
    chosen = mesh.edges_along(direction)
    assert chosen.any()
    along = torch.nn.functional.normalize(edge_vectors(mesh.vertices, mesh.topology)[chosen], dim=-1)
    directions = mesh.principal_directions[mesh.topology.edges[chosen, 0]]
    return float(torch.acos((directions @ along[..., None]).abs().amax((1, 2)).clamp(max=1)).max())


@pytest.mark.parametrize("name", [n for n in PRINCIPAL if n != "sphere"])
def test_principal_edges_follow_principal_directions(name):
    """First order in the edge length (order 1 or better; zero for straight lines)."""
    surface = SURFACES[name]()
    for make, direction in (
        (principal_quads, "u"),
        (principal_quads, "v"),
        (principal_triangles, "u"),
        (lambda s, r, c: principal_triangles(s, r, c, along="v"), "v"),
    ):
        coarse, fine = (deviation(make(surface, n, 2 * n), direction) for n in (10, 20))
        assert fine < 0.6 * coarse or fine < 1e-7
        assert fine < 0.2


def test_one_third_of_the_edges_is_principal():
    for along in ("u", "v"):
        mesh = principal_triangles(Torus(), 12, 20, along=along)
        assert mesh.edges_along(along).double().mean() == pytest.approx(1 / 3)
        assert not mesh.edges_along("v" if along == "u" else "u").any()
        across = torch.tensor([0, 0])
        across[("u", "v").index(along)] = 1
        ends = mesh.parameters[mesh.topology.edges[mesh.edges_along(along)]]
        assert ((ends[:, 0] - ends[:, 1]).abs() > 1e-9).long().unique(dim=0).tolist() == [across.tolist()]


def test_quads_have_both_families():
    mesh = principal_quads(Sphere(), 6, 8)
    along_u, along_v = mesh.edges_along("u"), mesh.edges_along("v")
    assert torch.equal(along_u, ~along_v)
    assert (int(along_u.sum()), int(along_v.sum())) == (5 * 8, 6 * 8)


def test_lattice_edges_are_symmetric_about_the_principal_ones():
    """On surfaces of revolution, with principal edges on parallels, all triangles are isosceles."""
    mesh = principal_triangles(Hyperboloid(), 8, 16)
    triangles = mesh.topology.triangles
    lengths = (mesh.vertices[triangles] - mesh.vertices[triangles.roll(1, 1)]).norm(dim=-1)
    low, middle, high = lengths.sort(dim=1).values.unbind(1)
    assert torch.minimum((high - middle).abs(), (middle - low).abs()).max() < 1e-12


# ---- energies ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "surface",
    [Sphere(), Torus(), Cylinder(), Catenoid(), Enneper(), PrincipalHelicoid(), PrincipalParaboloid()],
    ids=lambda surface: type(surface).__name__,
)
def test_energy_of_principal_quads_converges_with_order_two(surface):
    errors = []
    for n in (8, 16, 32):
        errors.append(energy(principal_quads(surface, n, 2 * n)) - interior_absolute_curvature(surface, n, 2 * n))
    assert min(math.log2(errors[0] / errors[1]), math.log2(errors[1] / errors[2])) > 1.9


def test_interior_curvature_on_closed_surfaces_is_c():
    for surface in (Torus(), Sphere()):
        assert interior_absolute_curvature(surface, 9, 7) == pytest.approx(surface.total_absolute_curvature())
    # of a cylinder the boundary circles carry nothing, and the generators all of C
    assert interior_absolute_curvature(Cylinder(), 9, 7) == pytest.approx(Cylinder().total_absolute_curvature())
    # Enneper: |k| dA = 2 du dv for either family
    assert interior_absolute_curvature(Enneper(0.5), 4, 8) == pytest.approx(2 * (3 / 4 + 7 / 8))


@pytest.mark.parametrize(("a", "b", "p", "q"), [(1.0, -0.8, 1.0, 1.5), (0.5, -1.0, 1.0, 1.0), (-0.7, 0.4, 0.5, 1.2)])
def test_energy_per_area_of_the_principal_lattice_on_a_saddle(a, b, p, q):
    """|a| + |b| + 2 |a| p^2 / q^2 for triangles, principal edge 2p along x, rows q apart; |a| + |b| for quads."""
    assert a * b < 0
    assert abs(b) * q**2 > abs(a) * p**2
    h = 1e-4
    for along, curved in (("u", (a, b)), ("v", (b, a))):
        sizes = (6 * p * h, 6 * q * h) if along == "u" else (6 * q * h, 6 * p * h)
        counts = (12, 6) if along == "u" else (6, 12)  # rows, columns
        surface = Paraboloid(*curved, half_widths=sizes)
        triangles = parameter_triangles(surface, *counts, along=along)
        assert per_area(triangles) == pytest.approx(abs(a) + abs(b) + 2 * abs(a) * p**2 / q**2, rel=1e-5)
        assert per_area(parameter_quads(surface, *counts)) == pytest.approx(abs(a) + abs(b), rel=1e-5)


def per_area(mesh):
    """E per area at the vertex in the origin: half the terms of its edges over its third (quarter) of its faces."""
    topology = mesh.topology
    centre = int(mesh.parameters.norm(dim=1).argmin())
    assert mesh.parameters[centre].norm() < 1e-12
    terms = edge_lengths(mesh.vertices, topology)[: topology.num_interior_edges]
    terms = terms * dual_edge_lengths(mesh.vertices, topology)
    around = (topology.interior_edges == centre).any(1)
    corners = topology.corners == centre
    areas = (face_areas(mesh.vertices, topology) / topology.face_sizes)[topology.corner_faces[corners]]
    return float(terms[around].sum() / 2 / areas.sum())


def test_quads_of_developables_are_planar():
    for name in ("cylinder", "cone"):
        mesh = principal_quads(SURFACES[name](), 5, 9)
        a, b, c, d = mesh.vertices[mesh.topology.corners.view(-1, 4)].unbind(1)
        volume = (torch.linalg.cross(c - a, d - b) * (b - a)).sum(-1)
        assert volume.abs().max() < 1e-15


def test_rows_and_columns_stay_along_v_and_u():
    tall = principal_quads(Cylinder(1.0, 8.0), 2, 40)
    assert corner_angles(tall.vertices, tall.topology).min() > math.pi / 2 - 0.1
    assert edge_lengths(tall.vertices, tall.topology)[tall.edges_along("v")].unique().tolist() == pytest.approx([4.0])


# ---- errors --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: principal_quads(FreeFormPatch(), 4, 4), "FreeFormPatch are not principal.*exist on Sphere, Torus"),
        (lambda: principal_triangles(Paraboloid(), 4, 4), "Paraboloid are not principal"),
        (lambda: interior_absolute_curvature(Paraboloid(), 4, 4), "Paraboloid are not principal"),
        (lambda: principal_triangles(Torus(), 7, 9), r'rows must be even, got 7.*Take 8, or principal edges along="v"'),
        (lambda: principal_triangles(Torus(), 8, 9, along="v"), "columns must be even, got 9"),
        (lambda: principal_triangles(Torus(), 2, 9), "rows must be an integer of at least 4 .v is periodic., got 2"),
        (lambda: principal_quads(Torus(), 8, 2), "columns must be an integer of at least 3"),
        (lambda: principal_quads(Sphere(), 1, 8), "rows must be an integer of at least 2"),
        (lambda: principal_quads(Enneper(), 0, 8), "rows must be an integer of at least 1"),
        (lambda: principal_quads(Enneper(), 2.5, 8), "rows must be an integer"),
        (lambda: principal_triangles(Sphere(), 8, 8, along="v", ends="zigzag"), "holes at the poles"),
        (lambda: principal_triangles(Torus(), 8, 8, along="w"), 'along must be "u" or "v"'),
        (lambda: principal_triangles(Torus(), 8, 8, ends="open"), 'ends must be "straight" or "zigzag"'),
        (lambda: principal_quads(Torus(), 8, 8).edges_along("x"), 'direction must be "u" or "v"'),
    ],
)
def test_errors(make, message):
    with pytest.raises(MeshError, match=message):
        make()


def test_smallest_meshes():
    patch, sphere, cap = Enneper(), Sphere(), Sphere(latitudes=(0.0, math.pi / 2))
    for mesh in (
        principal_quads(patch, 1, 1),
        principal_triangles(patch, 1, 1),
        principal_triangles(patch, 1, 1, ends="zigzag"),
        principal_quads(sphere, 2, 3),
        principal_triangles(sphere, 2, 3),
        principal_triangles(sphere, 2, 4, along="v"),
        principal_quads(cap, 1, 3),
        principal_triangles(cap, 1, 3),
        principal_triangles(cap, 1, 4, along="v"),
        principal_quads(Torus(), 3, 3),
        principal_triangles(Torus(), 4, 3),
    ):
        assert euler_characteristic(mesh.topology) == (
            2 if mesh.surface is sphere else 0 if all(mesh.surface.periodic) else 1
        )
