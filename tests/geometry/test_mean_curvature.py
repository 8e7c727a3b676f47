from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, collinear_face, icosphere, split_faces, torus
from helpers import DOUBLE, cube, wavy_grid

from torchfair import Topology
from torchfair.geometry import face_areas, mean_curvature_vectors, vertex_normals


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_half_the_gradient_of_the_total_area(mesh):
    vertices, topology = mesh()
    gradient = torch.func.grad(lambda v: face_areas(v, topology).sum())(vertices)
    torch.testing.assert_close(mean_curvature_vectors(vertices, topology), gradient / 2)


@pytest.mark.parametrize("mesh", [GENERIC["triangles"], GENERIC["closed"]])
def test_equals_the_cotangent_formula_in_a_loop(mesh):
    vertices, topology = mesh()
    expected = torch.zeros_like(vertices)
    for face in topology.face_lists():
        for k in range(3):
            top, v, w = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            p, q = vertices[v] - vertices[top], vertices[w] - vertices[top]
            cotangent = (p @ q) / torch.linalg.cross(p, q).norm()
            expected[v] += cotangent * (vertices[v] - vertices[w]) / 4
            expected[w] += cotangent * (vertices[w] - vertices[v]) / 4
    torch.testing.assert_close(mean_curvature_vectors(vertices, topology), expected)


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_minkowski_identity(mesh):
    """Area is homogeneous of degree two in the vertices: sum_v H_v . v = area."""
    vertices, topology = mesh()
    total = (mean_curvature_vectors(vertices, topology) * vertices).sum()
    torch.testing.assert_close(total, face_areas(vertices, topology).sum())


def test_converges_to_mean_curvature_of_the_sphere_with_second_order():
    errors = []
    for level in (2, 3, 4):
        vertices, topology = icosphere(level)
        vectors = mean_curvature_vectors(3 * vertices, topology)
        outward = (vectors * vertex_normals(vertices, topology)).sum(-1)
        assert (outward > 0).all()
        errors.append(abs(outward.sum().item() - 12 * math.pi))  # integral of H = 1/R over 4 pi R^2, R = 3
    assert math.log2(errors[0] / errors[1]) > 1.9
    assert math.log2(errors[1] / errors[2]) > 1.9


def test_does_not_depend_on_orientation():
    vertices, topology = torus()
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    vectors = mean_curvature_vectors(vertices, topology)
    assert vectors.norm(dim=-1).min() > 0.1
    torch.testing.assert_close(mean_curvature_vectors(vertices, turned), vectors)


def test_zero_in_the_plane_and_for_faces_without_area():
    vertices, topology = wavy_grid(5, 5, triangles=True)
    flat = vertices * torch.tensor([1.0, 1, 0], dtype=DOUBLE)
    inside = ~topology.is_boundary_vertex
    vectors = mean_curvature_vectors(flat, topology)
    torch.testing.assert_close(vectors[inside], torch.zeros_like(vectors[inside]))
    assert vectors[~inside].norm(dim=-1).min() > 0.1
    assert not mean_curvature_vectors(*DEGENERATE["collapsed"]()).any()
    vertices, topology = collinear_face()
    without = Topology.from_faces(topology.face_lists()[:2], topology.num_vertices)
    torch.testing.assert_close(mean_curvature_vectors(vertices, topology), mean_curvature_vectors(vertices, without))


def test_of_a_planar_polygon_does_not_depend_on_its_diagonals_at_other_vertices():
    """Splitting the faces of a cube moves no area, so the vectors stay the same."""
    expected = mean_curvature_vectors(*cube())
    torch.testing.assert_close(mean_curvature_vectors(*split_faces(cube())), expected)
    torch.testing.assert_close(expected, (2 * cube()[0] - 1) / 2)
