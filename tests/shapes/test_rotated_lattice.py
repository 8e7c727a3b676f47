"""Lattices turned against the parameter lines."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair.errors import MeshError, TorchfairError
from torchfair.geometry import corner_angles, edge_vectors, face_normals
from torchfair.shapes import SURFACES, Enneper, Paraboloid, Sphere, Torus, rotated_lattice

NAMES = [name for name in SURFACES if name != "sphere"]
KINDS = ["triangles", "quads", "split"]
PLANE = Paraboloid(0.0, 0.0, (2.0, 1.5))


def check(mesh, least_angle):
    """One manifold piece of the right topology, oriented like the surface, without slivers."""
    topology, surface = mesh.topology, mesh.surface
    torch.testing.assert_close(mesh.vertices, surface.position(*mesh.parameters.T))
    assert len(topology.boundary_loops()) == {(True, True): 0, (True, False): 2, (False, False): 1}[surface.periodic]
    euler = topology.num_vertices - topology.num_edges + topology.num_faces
    assert euler == (0 if surface.periodic[0] else 1)
    assert topology.valences.min() >= 2
    facing = (face_normals(mesh.vertices, topology)[topology.corner_faces] * mesh.normals[topology.corners]).sum(-1)
    assert facing.min() > 0.2
    assert math.degrees(corner_angles(mesh.vertices, topology).min()) > least_angle


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_every_kind_on_every_surface(name, kind):
    mesh = rotated_lattice(SURFACES[name](), 12, 18, 0.3, kind=kind)
    check(mesh, 15)
    across, along = (cells + (not periodic) for cells, periodic in zip((18, 12), mesh.surface.periodic, strict=True))
    assert mesh.topology.num_vertices == pytest.approx(across * along, rel=0.1)
    assert mesh.topology.is_triangular == (kind != "quads")


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    st.sampled_from(NAMES),
    st.sampled_from(KINDS),
    st.integers(8, 16),
    st.integers(8, 16),
    st.one_of(st.floats(-4, 4), st.sampled_from([0.0, math.pi / 6, math.pi / 4, math.pi / 2])),
)
def test_any_size_and_angle(name, kind, rows, columns, angle):
    check(rotated_lattice(SURFACES[name](), rows, columns, angle, kind=kind), 13)


def inner_edges(mesh, distance):
    """Edge vectors whose ends keep a distance from the boundary of the plane rectangle."""
    ends = torch.tensor(mesh.surface.domain, dtype=torch.float64)
    inside = ((mesh.parameters > ends[:, 0] + distance) & (mesh.parameters < ends[:, 1] - distance)).all(1)
    edges = edge_vectors(mesh.vertices, mesh.topology)
    return edges[inside[mesh.topology.edges].all(1)]


@pytest.mark.parametrize(("kind", "period"), [("triangles", math.pi / 3), ("quads", math.pi / 2)])
@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0, -0.4])
def test_angle_and_regularity_in_the_plane(kind, period, angle):
    mesh = rotated_lattice(PLANE, 15, 20, angle, kind=kind)
    edges = inner_edges(mesh, 0.5)
    lengths = edges.norm(dim=1)
    assert lengths.max() - lengths.min() < 1e-12
    off = torch.remainder(torch.atan2(edges[:, 1], edges[:, 0]) - angle + period / 2, period) - period / 2
    assert off.abs().max() < 1e-12


def test_split_cuts_all_squares_alike():
    edges = inner_edges(rotated_lattice(PLANE, 15, 20, 0.3, kind="split"), 0.5)
    lengths = edges.norm(dim=1)
    diagonals = edges[lengths > 1.2 * lengths.min()]
    torch.testing.assert_close(
        diagonals.norm(dim=1), torch.full((len(diagonals),), float(lengths.min()) * 2**0.5).double()
    )
    off = torch.remainder(torch.atan2(diagonals[:, 1], diagonals[:, 0]) - 0.3 - math.pi / 4, math.pi)
    assert torch.minimum(off, math.pi - off).max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_closed_lattice_has_no_seam(kind):
    """On the torus all vertices are alike, and the angle is met up to the rounding of the lattice."""
    torus = Torus(4.0, 1.0)
    mesh = rotated_lattice(torus, 16, 60, 0.3, kind=kind)
    valence = {"triangles": 6, "quads": 4, "split": 6}[kind]
    assert mesh.topology.valences.unique().tolist() == [valence]
    start, end = mesh.parameters[mesh.topology.edges].unbind(1)
    step = torch.remainder(end - start + math.pi, 2 * math.pi) - math.pi
    # the mean length of x_u is the major radius
    turn = torch.atan2(step[:, 1], 4.0 * step[:, 0])
    period = math.pi / 3 if kind == "triangles" else math.pi / 4
    off = torch.remainder(turn - 0.3 + period / 2, period) - period / 2
    assert off.abs().max() < 0.06


def test_boundary_is_the_parameter_rectangle():
    for kind in KINDS:
        mesh = rotated_lattice(Enneper(), 10, 12, 0.4, kind=kind)
        on_boundary = (mesh.parameters.abs() > 0.8 - 1e-9).any(1)
        assert torch.equal(on_boundary, mesh.topology.is_boundary_vertex)
        corners = (mesh.parameters.abs() > 0.8 - 1e-9).all(1)
        assert int(corners.sum()) == 4


def test_quads_away_from_the_boundary():
    sizes = rotated_lattice(Torus(), 12, 30, 0.5, kind="quads").topology.face_sizes
    assert sizes.unique().tolist() == [4]
    mesh = rotated_lattice(PLANE, 16, 20, 0.5, kind="quads")
    near = mesh.topology.is_boundary_vertex[mesh.topology.corners].double()
    triangles = mesh.topology.face_sizes == 3
    assert 0.1 < triangles.double().mean() < 0.4
    touches = torch.zeros(mesh.topology.num_faces).double().index_add(0, mesh.topology.corner_faces, near) > 0
    assert (triangles & ~touches).sum() < 0.25 * triangles.sum()


def test_deterministic():
    first, second = (rotated_lattice(Enneper(), 9, 9, 0.7) for _ in range(2))
    assert torch.equal(first.vertices, second.vertices)
    assert torch.equal(first.topology.corners, second.topology.corners)


def test_errors():
    with pytest.raises(MeshError, match=r"around a pole. Use a zone"):
        rotated_lattice(Sphere(), 8, 8, 0.3)
    with pytest.raises(MeshError, match='kind must be "triangles", "quads" or "split"'):
        rotated_lattice(Enneper(), 8, 8, 0.3, kind="hexagons")
    with pytest.raises(MeshError, match="rows must be an integer of at least 3"):
        rotated_lattice(Enneper(), 2, 8, 0.3)
    with pytest.raises(TorchfairError, match="angle must be a finite number"):
        rotated_lattice(Enneper(), 8, 8, math.nan)
    for torus, rows, columns, kind in ((Torus(10.0, 0.2), 3, 4, "quads"), (Torus(4.0, 1.0), 6, 8, "split")):
        with pytest.raises(MeshError, match="too coarse to close up"):
            rotated_lattice(torus, rows, columns, math.pi / 4, kind=kind)
