from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import GENERIC, collinear_face, flat_pair, flat_squares
from helpers import DOUBLE, cube, tetrahedron

from torchfair.geometry import dihedral_angles, dual_edge_lengths, face_normals


def test_closed_forms():
    torch.testing.assert_close(dual_edge_lengths(*cube()), torch.full((12,), math.sqrt(2), dtype=DOUBLE))
    between = math.sqrt(2 + 2 / 3)  # the normals of a regular tetrahedron form one, with n . n' = -1/3
    torch.testing.assert_close(dual_edge_lengths(*tetrahedron()), torch.full((6,), between, dtype=DOUBLE))


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_twice_the_sine_of_half_the_dihedral_angle(mesh):
    mesh = mesh()
    torch.testing.assert_close(dual_edge_lengths(*mesh), 2 * (dihedral_angles(*mesh).abs() / 2).sin())


def test_equals_the_distance_of_normals_in_a_loop():
    vertices, topology = GENERIC["mixed"]()
    normals = face_normals(vertices, topology)
    naive = [(normals[f] - normals[g]).norm() for f, g in topology.interior_edge_faces.tolist()]
    torch.testing.assert_close(dual_edge_lengths(vertices, topology), torch.stack(naive))


@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
def test_zero_with_zero_subgradient_at_flat_edges_and_slope_one_beside(mesh):
    vertices, topology = mesh()
    assert dual_edge_lengths(vertices, topology).tolist() == [0.0]
    for jacobian in (torch.func.jacrev, torch.func.jacfwd):
        assert not jacobian(dual_edge_lengths)(vertices, topology).any()
    lifted = vertices.clone()
    lifted[2:4, 2] = 1e-9 if mesh is flat_squares else torch.tensor([1e-9, 0.0])
    torch.testing.assert_close(dual_edge_lengths(lifted, topology).item(), 1e-9, rtol=1e-6, atol=0)


def test_zero_beside_degenerate_faces():
    vertices, topology = collinear_face()
    lengths = dual_edge_lengths(vertices, topology)
    beside = (topology.interior_edge_faces == 2).any(1)
    assert not lengths[beside].any()
    assert (lengths[~beside] > 0.1).all()
    assert not torch.func.jacrev(dual_edge_lengths)(vertices, topology)[beside].any()
