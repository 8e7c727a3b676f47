from __future__ import annotations

import itertools
import math

import pytest
import torch
from geometry_meshes import (
    DEGENERATE,
    GENERIC,
    coincident_corners,
    collinear_face,
    icosphere,
    split_faces,
    with_isolated,
)
from helpers import DOUBLE, cube

from torchfair import Topology
from torchfair.geometry import (
    adjacent_normals,
    corner_angles,
    degenerate_faces,
    face_area_vectors,
    face_areas,
    face_normals,
    vertex_normals,
)


def test_normals_of_the_cube_point_outward_along_the_axes():
    axes = torch.eye(3, dtype=DOUBLE)
    expected = torch.stack([-axes[0], axes[0], -axes[1], axes[1], -axes[2], axes[2]])
    torch.testing.assert_close(face_normals(*cube()), expected)


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_face_normals_are_area_vectors_divided_by_areas(mesh):
    mesh = mesh()
    torch.testing.assert_close(face_normals(*mesh) * face_areas(*mesh)[:, None], face_area_vectors(*mesh))
    torch.testing.assert_close(face_normals(*mesh).norm(dim=-1), torch.ones(mesh[1].num_faces, dtype=DOUBLE))
    assert not degenerate_faces(*mesh).any()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_needle_is_degenerate_below_the_documented_height(dtype):
    topology = Topology.from_faces([[0, 1, 2]])
    limit = 16 * torch.finfo(dtype).eps  # area h/2 against 4 eps times squared lengths 1 + 1 + O(h)
    for factor, degenerate in ((0.4, True), (0.98, True), (1.02, False), (3.0, False)):
        needle = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, factor * limit, 0]], dtype=dtype)
        assert degenerate_faces(needle, topology).item() is degenerate
        assert face_normals(needle, topology).tolist() == [[0.0, 0.0, 0.0 if degenerate else 1.0]]


@pytest.mark.parametrize("mesh", [collinear_face, coincident_corners, DEGENERATE["collapsed"]])
def test_degenerate_faces_have_the_zero_normal_with_zero_gradient(mesh):
    vertices, topology = mesh()
    mask = degenerate_faces(vertices, topology)
    assert mask.any()
    jacobian = torch.func.jacrev(face_normals)(vertices, topology)
    assert not face_normals(vertices, topology)[mask].any()
    assert not jacobian[mask].any()
    if not mask.all():
        assert jacobian[~mask].flatten(1).any(1).all()


def test_edges_beside_degenerate_faces_are_not_valid():
    vertices, topology = collinear_face()
    left, right, valid = adjacent_normals(vertices, topology)
    faces = topology.interior_edge_faces
    assert (valid == (faces != 2).all(1)).all()
    normals = face_normals(vertices, topology)
    torch.testing.assert_close(torch.stack([left, right], 1), normals[faces])


def test_vertex_normals_of_spheres_become_radial():
    errors = []
    for level in (2, 3, 4):
        vertices, topology = icosphere(level)
        errors.append((vertex_normals(vertices, topology) - vertices).norm(dim=-1).max().item())
    # first order: the stars of a split icosahedron are not symmetric
    assert all(math.log2(coarse / fine) > 0.95 for coarse, fine in itertools.pairwise(errors))


def test_vertex_normals_of_the_cube_do_not_depend_on_its_diagonals():
    expected = (cube()[0] * 2 - 1) / math.sqrt(3)
    torch.testing.assert_close(vertex_normals(*cube()), expected)
    for seed in range(4):
        torch.testing.assert_close(vertex_normals(*split_faces(cube(), seed)), expected)


def test_vertex_normals_equal_the_angle_weighted_sum_in_a_loop():
    vertices, topology = GENERIC["mixed"]()
    total = torch.zeros_like(vertices)
    angles, normals = corner_angles(vertices, topology), face_normals(vertices, topology)
    for h, v in enumerate(topology.corners.tolist()):
        total[v] += angles[h] * normals[topology.corner_faces[h]]
    torch.testing.assert_close(vertex_normals(vertices, topology), total / total.norm(dim=-1, keepdim=True))


def test_vertex_normal_is_zero_where_there_is_none():
    vertices, topology = with_isolated(cube())
    assert not vertex_normals(vertices, topology)[-1].any()
    pillow = Topology.from_faces([[0, 1, 2], [0, 2, 1]])  # two sides of one triangle: normals cancel
    corners = torch.tensor([[0.1, 0.2, 0.3], [1.3, 0.4, 0.5], [0.2, 1.1, 0.9]], dtype=DOUBLE, requires_grad=True)
    normals = vertex_normals(corners, pillow)
    assert not normals.any()
    normals.sum().backward()
    assert not corners.grad.any()
