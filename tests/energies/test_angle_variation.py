from __future__ import annotations

import itertools
import math

import hypothesis.strategies as st
import pytest
import torch
import trimesh
from geometry_meshes import (
    GENERIC,
    capped_prism,
    collinear_face,
    edge_table,
    flat_pair,
    flat_squares,
    icosphere,
    random_polytope,
    split_faces,
)
from helpers import DOUBLE, cube, random_rotation, tetrahedron
from hypothesis import given, settings

from torchfair.energies import angle_variation, angle_variation_per_edge, total_mean_curvature
from torchfair.geometry import face_normals


def test_unit_cube_and_boxes():
    vertices, topology = cube()
    assert angle_variation(vertices, topology).item() == pytest.approx(6 * math.pi)
    box = vertices * torch.tensor([2.0, 3, 5], dtype=DOUBLE)
    assert angle_variation(box, topology).item() == pytest.approx(math.pi / 2 * 4 * (2 + 3 + 5))


def test_regular_tetrahedron():
    length = 2 * math.sqrt(2)
    assert angle_variation(*tetrahedron()).item() == pytest.approx(6 * length * (math.pi - math.acos(1 / 3)))


@pytest.mark.parametrize("sides", [3, 4, 7, 64])
def test_prisms_and_their_limit_the_cylinder(sides):
    """Lateral edges turn by 2 pi in all whatever their number; the rims turn by a right angle."""
    radius, height = 1.5, 3.0
    rim = 2 * sides * radius * math.sin(math.pi / sides)
    value = angle_variation(*capped_prism(sides, radius, height)).item()
    assert value == pytest.approx(2 * math.pi * height + 2 * rim * math.pi / 2)
    cylinder = 2 * math.pi * height + 2 * math.pi**2 * radius
    assert abs(value - cylinder) < 2 * math.pi**4 * radius / (6 * sides**2) * 1.01


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_of_convex_polytopes_is_twice_the_total_mean_curvature(seed):
    mesh = random_polytope(seed)
    torch.testing.assert_close(angle_variation(*mesh), 2 * total_mean_curvature(*mesh))


@pytest.mark.parametrize("mesh", [cube, lambda: capped_prism(7)])
def test_of_convex_polytopes_does_not_depend_on_their_diagonals(mesh):
    expected = angle_variation(*mesh())
    for seed in range(5):
        torch.testing.assert_close(angle_variation(*split_faces(mesh(), seed)), expected)


def test_tends_to_eight_pi_r_on_spheres_with_second_order():
    errors = [abs(angle_variation(*icosphere(level)).item() - 8 * math.pi) for level in (1, 2, 3)]
    assert all(math.log2(coarse / fine) > 1.9 for coarse, fine in itertools.pairwise(errors))
    vertices, topology = icosphere(3)
    assert angle_variation(5 * vertices, topology).item() == pytest.approx(40 * math.pi, rel=1e-2)


@pytest.mark.parametrize("mesh", [GENERIC["triangles"], GENERIC["closed"], lambda: random_polytope(3)])
def test_agrees_with_trimesh(mesh):
    vertices, topology = mesh()
    peer = trimesh.Trimesh(vertices.numpy(), topology.triangles.numpy(), process=False)
    theirs = {}
    for (v, w), angle in zip(peer.face_adjacency_edges.tolist(), peer.face_adjacency_angles, strict=True):
        theirs[min(v, w), max(v, w)] = angle * (vertices[v] - vertices[w]).norm().item()
    ours = edge_table(topology, angle_variation_per_edge(vertices, topology))
    assert {pair: value.item() for pair, value in ours.items()} == pytest.approx(theirs, abs=1e-6)
    assert angle_variation(vertices, topology).item() == pytest.approx(sum(theirs.values()))


def test_equals_the_sum_in_a_loop_over_planar_and_other_faces():
    vertices, topology = GENERIC["mixed"]()
    normals = face_normals(vertices, topology)
    total = 0.0
    for (v, w), (f, g) in zip(topology.interior_edges.tolist(), topology.interior_edge_faces.tolist(), strict=True):
        total += (vertices[v] - vertices[w]).norm().item() * math.acos((normals[f] @ normals[g]).item())
    assert angle_variation(vertices, topology).item() == pytest.approx(total)


@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
def test_value_and_subgradient_zero_at_flat_edges_and_slopes_on_both_sides(mesh):
    vertices, topology = mesh()
    assert angle_variation(vertices, topology).item() == 0
    for gradient in (torch.func.jacrev, torch.func.jacfwd):
        assert not gradient(angle_variation)(vertices, topology).any()
    length = 2.0 if mesh is flat_pair else 1.0
    left = (vertices[:, 1] > 0).to(DOUBLE)
    for side in (-1, 1):
        bent = vertices.clone()
        bent[:, 2] = side * 1e-8 * left
        slope = torch.func.grad(angle_variation)(bent, topology)[:, 2] @ left
        assert slope.item() == pytest.approx(side * length, rel=1e-6)


def test_boundary_edges_and_edges_beside_degenerate_faces_carry_nothing():
    vertices, topology = collinear_face()
    terms = angle_variation_per_edge(vertices, topology)
    beside = (topology.interior_edge_faces == 2).any(1)
    assert not terms[beside].any()
    assert (terms[~beside] > 0.1).all()
    alone = topology.face_lists()[:1]
    assert angle_variation(vertices, type(topology).from_faces(alone, topology.num_vertices)).item() == 0


def test_digits_survive_far_from_the_origin_and_in_single_precision():
    vertices, topology = icosphere(2)
    vertices = (vertices * 1024).round() / 1024
    value = angle_variation(vertices, topology).item()
    assert angle_variation(vertices + 2.0**20, topology).item() == pytest.approx(value, rel=1e-14)
    turned = (vertices @ random_rotation(2).T).float()
    assert angle_variation(turned, topology).item() == pytest.approx(value, rel=1e-5)
