from __future__ import annotations

import math

import numpy as np
import pytest
import torch
import trimesh
from geometry_meshes import (
    GENERIC,
    capped_prism,
    coincident_corners,
    collinear_face,
    edge_table,
    flat_pair,
    flat_squares,
    random_polytope,
    split_faces,
)
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.geometry import dihedral_angles, edge_vectors, face_normals


def hinge(angle: float, *, polygon: bool = False) -> tuple[torch.Tensor, Topology]:
    """The flat pair of faces, the right one folded down by ``angle``: convex for positive angles."""
    vertices, topology = flat_squares() if polygon else flat_pair()
    right = vertices[:, 1] < 0
    vertices[right, 1], vertices[right, 2] = -math.cos(angle), -math.sin(angle)
    return vertices, topology


@pytest.mark.parametrize("polygon", [False, True])
@pytest.mark.parametrize("angle", [-3.1, -2.0, -math.pi / 2, -0.3, -1e-9, 0.0, 1e-9, 0.3, math.pi / 2, 2.0, 3.1])
def test_a_hinge_has_its_angle_positive_when_folded_down(angle, polygon):
    torch.testing.assert_close(dihedral_angles(*hinge(angle, polygon=polygon)).item(), angle, rtol=1e-6, atol=1e-14)


def test_folded_onto_itself_is_pi():
    assert dihedral_angles(*hinge(math.pi)).abs().item() == pytest.approx(math.pi)


def test_regular_solids():
    torch.testing.assert_close(dihedral_angles(*cube()), torch.full((12,), math.pi / 2, dtype=DOUBLE))
    beyond = math.pi - math.acos(1 / 3)  # 109.47 degrees
    torch.testing.assert_close(dihedral_angles(*tetrahedron()), torch.full((6,), beyond, dtype=DOUBLE))


def test_convex_polytopes_have_positive_angles_and_zero_inside_split_faces():
    assert (dihedral_angles(*random_polytope(2)) > 0).all()
    prism = capped_prism(6)
    angles = dihedral_angles(*split_faces(prism))
    torch.testing.assert_close(angles.abs().sum(), dihedral_angles(*prism).abs().sum())


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_size_is_the_angle_between_the_normals_and_sign_that_of_the_triple_product(mesh):
    vertices, topology = mesh()
    angles = dihedral_angles(vertices, topology)
    normals, edges = face_normals(vertices, topology).numpy(), edge_vectors(vertices, topology).numpy()
    for e, (f, g) in enumerate(topology.interior_edge_faces.tolist()):
        n, m = normals[f], normals[g]
        assert abs(angles[e].item()) == pytest.approx(math.acos(n @ m), abs=1e-7)
        assert math.copysign(1, angles[e].item()) == np.sign(np.cross(n, m) @ edges[e])


@pytest.mark.parametrize("mesh", [GENERIC["triangles"], lambda: random_polytope(4)])
def test_agrees_with_trimesh(mesh):
    vertices, topology = mesh()
    peer = trimesh.Trimesh(vertices.numpy(), topology.triangles.numpy(), process=False)
    pairs = [tuple(sorted(pair)) for pair in peer.face_adjacency_edges.tolist()]
    theirs = dict(zip(pairs, peer.face_adjacency_angles, strict=True))
    ours = edge_table(topology, dihedral_angles(vertices, topology).abs())
    assert {pair: angle.item() for pair, angle in ours.items()} == pytest.approx(theirs, abs=1e-7)


def test_gradient_at_the_flat_edge_is_that_of_the_signed_angle():
    """Lifting the tip of a triangle of height 1 by dz makes the edge concave by dz."""
    vertices, topology = flat_pair()
    expected = torch.zeros(1, 4, 3, dtype=DOUBLE)
    expected[0, :, 2] = torch.tensor([1.0, 1, -1, -1])
    for jacobian in (torch.func.jacrev, torch.func.jacfwd):
        torch.testing.assert_close(jacobian(dihedral_angles)(vertices, topology), expected)


@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
def test_gradient_at_the_flat_edge_in_any_position(mesh):
    """After a rotation the faces are flat up to rounding only, and the gradient must not follow the noise."""
    vertices, topology = mesh()
    reference = torch.func.jacrev(dihedral_angles)(vertices, topology)
    assert reference.abs().max() > 0.4
    for seed in range(20):
        rotation = random_rotation(seed)
        rotated = torch.func.jacrev(dihedral_angles)(vertices @ rotation.T, topology)
        torch.testing.assert_close(rotated, reference @ rotation.T, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("polygon", [False, True])
def test_smooth_across_the_flat_edge(polygon):
    vertices, topology = hinge(0.0, polygon=polygon)
    up = torch.zeros_like(vertices)
    up[vertices[:, 1] > 0, 2] = 1.0
    for h in (1e-3, 1e-6, 1e-9):
        before, after = (dihedral_angles(vertices + s * h * up, topology).item() for s in (-1, 1))
        assert before == pytest.approx(-after)
        assert after == pytest.approx(-math.atan(h))


@pytest.mark.parametrize("mesh", [collinear_face, coincident_corners])
def test_edges_beside_degenerate_faces_carry_no_angle(mesh):
    vertices, topology = mesh()
    degenerate = (face_normals(vertices, topology) == 0).all(-1)
    beside = degenerate[topology.interior_edge_faces].any(1)
    assert beside.any()
    angles, jacobian = dihedral_angles(vertices, topology), torch.func.jacrev(dihedral_angles)(vertices, topology)
    assert not angles[beside].any()
    assert not jacobian[beside].any()
    assert angles[~beside].all()


def test_boundary_edges_have_no_entry():
    vertices, topology = wavy_grid(4, 4)
    assert dihedral_angles(vertices, topology).shape == (topology.num_interior_edges,)
    assert topology.num_interior_edges < topology.num_edges


def test_an_edge_of_length_zero_between_good_polygons_carries_no_angle():
    points = [[0.0, 0, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0], [0, -1, 1], [1, -1, 0]]
    vertices, topology = torch.tensor(points, dtype=DOUBLE), flat_squares()[1]
    assert dihedral_angles(vertices, topology).tolist() == [0.0]
    assert not torch.func.jacrev(dihedral_angles)(vertices, topology).any()
