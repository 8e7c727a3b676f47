from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import capped_prism, icosphere, mixed_grid, split_faces, torus
from helpers import DOUBLE, cube, tetrahedron

from torchfair import Topology
from torchfair.geometry import face_area_vectors, face_areas


def test_area_vectors_equal_the_sum_of_cross_products():
    vertices, topology = mixed_grid()
    vectors = face_area_vectors(vertices, topology)
    for f, face in enumerate(topology.face_lists()):
        naive = torch.zeros(3, dtype=DOUBLE)
        for i, v in enumerate(face):
            w = face[(i + 1) % len(face)]
            naive += torch.linalg.cross(vertices[v], vertices[w]) / 2
        torch.testing.assert_close(vectors[f], naive)


@pytest.mark.parametrize("sides", [3, 4, 5, 12])
def test_prism_has_the_areas_of_the_book(sides):
    areas = face_areas(*capped_prism(sides, radius=2.0, height=3.0))
    rectangle = 3.0 * 4 * math.sin(math.pi / sides)
    polygon = sides / 2 * 4 * math.sin(2 * math.pi / sides)
    torch.testing.assert_close(areas, torch.tensor([rectangle] * sides + [polygon] * 2, dtype=DOUBLE))


@pytest.mark.parametrize("mesh", [cube, tetrahedron, torus, lambda: capped_prism(7), lambda: icosphere(1)])
def test_area_vectors_of_a_closed_mesh_sum_to_zero(mesh):
    torch.testing.assert_close(face_area_vectors(*mesh()).sum(0), torch.zeros(3, dtype=DOUBLE))


def test_a_polygon_has_the_area_vector_of_its_triangles_planar_or_not():
    vertices, topology = mixed_grid()
    _, cut = split_faces((vertices, topology), seed=1)
    vectors, triangles = face_area_vectors(vertices, topology), face_area_vectors(vertices, cut)
    sizes = (topology.face_sizes - 2).tolist()
    torch.testing.assert_close(torch.stack([part.sum(0) for part in triangles.split(sizes)]), vectors)


def test_a_polygon_that_is_not_convex():
    arrow = torch.tensor([[0.0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]], dtype=DOUBLE)
    torch.testing.assert_close(
        face_area_vectors(arrow, Topology.from_faces([[0, 1, 2, 3]])), torch.tensor([[0.0, 0, 1]], dtype=DOUBLE)
    )


@pytest.mark.parametrize("mesh", [mixed_grid, lambda: capped_prism(9)])
def test_far_from_the_origin_only_the_digits_of_the_input_are_lost(mesh):
    vertices, topology = mesh()
    vertices = (vertices * 1024).round() / 1024  # so that the offset itself is exact
    far = vertices + torch.tensor([2.0**20, -(2.0**20), 2.0**20], dtype=DOUBLE)
    near_vectors, far_vectors = face_area_vectors(vertices, topology), face_area_vectors(far, topology)
    torch.testing.assert_close(far_vectors, near_vectors, rtol=1e-15, atol=1e-15)


def test_gradient_of_a_zero_area_is_zero():
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=DOUBLE, requires_grad=True)
    areas = face_areas(line, Topology.from_faces([[0, 1, 2]]))
    assert areas.tolist() == [0.0]
    areas.sum().backward()
    assert not line.grad.any()
