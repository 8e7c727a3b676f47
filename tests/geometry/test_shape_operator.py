from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import GENERIC, capped_prism, collinear_face, flat_pair, icosphere, split_faces, torus
from helpers import DOUBLE, cube, wavy_grid

from torchfair.geometry import dihedral_angles, edge_lengths, edge_vectors, face_normals, shape_operators

PLANAR = {
    "cube": cube,
    "prism": lambda: capped_prism(7),
    "sphere": lambda: icosphere(1),
    "with boundary": lambda: wavy_grid(4, 5, triangles=True),
    "split torus": lambda: split_faces(torus()),
}


def traces(matrices: torch.Tensor) -> torch.Tensor:
    return matrices.diagonal(dim1=-2, dim2=-1).sum(-1)


@pytest.mark.parametrize("mesh", PLANAR.values(), ids=PLANAR.keys())
@pytest.mark.parametrize("sine", [True, False])
def test_traces_sum_to_lengths_times_angles(mesh, sine):
    """Every interior edge counts in the stars of both its ends, on the boundary too, with one half each."""
    vertices, topology = mesh()
    angles = dihedral_angles(vertices, topology)
    lengths = edge_lengths(vertices, topology)[: topology.num_interior_edges]
    total = traces(shape_operators(vertices, topology, sine=sine)).sum()
    torch.testing.assert_close(total, (lengths * (angles.sin() if sine else angles)).sum())


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_equals_the_sum_over_the_star_in_a_loop(mesh):
    """Both directions of every edge, the left face first: the paper's formula word by word."""
    vertices, topology = mesh()
    normals = face_normals(vertices, topology)
    left_face = {}
    for f, face in enumerate(topology.face_lists()):
        for v, w in zip(face, face[1:] + face[:1], strict=True):
            left_face[v, w] = f
    expected = torch.zeros(topology.num_vertices, 3, 3, dtype=DOUBLE)
    for (v, w), f in left_face.items():
        if (w, v) in left_face:
            axis = torch.linalg.cross(normals[f], normals[left_face[w, v]])
            expected[v] += torch.outer(axis, vertices[w] - vertices[v]) / 2
    torch.testing.assert_close(shape_operators(vertices, topology), expected)


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_with_angles_every_edge_adds_its_own_direction(mesh):
    vertices, topology = mesh()
    expected = torch.zeros(topology.num_vertices, 3, 3, dtype=DOUBLE)
    edges, angles = edge_vectors(vertices, topology), dihedral_angles(vertices, topology)
    for e, (v, w) in enumerate(topology.interior_edges.tolist()):
        part = angles[e] * torch.outer(edges[e], edges[e]) / edges[e].norm() / 2
        expected[v] += part
        expected[w] += part
    torch.testing.assert_close(shape_operators(vertices, topology, sine=False), expected)


@pytest.mark.parametrize("mesh", PLANAR.values(), ids=PLANAR.keys())
@pytest.mark.parametrize("sine", [True, False])
def test_symmetric_where_faces_are_planar(mesh, sine):
    matrices = shape_operators(*mesh(), sine=sine)
    torch.testing.assert_close(matrices, matrices.mT)


def test_cube_corner_has_three_nonzero_eigenvalues():
    torch.testing.assert_close(shape_operators(*cube()), torch.eye(3, dtype=DOUBLE).expand(8, 3, 3) / 2)
    expected = torch.eye(3, dtype=DOUBLE).expand(8, 3, 3) * math.pi / 4
    torch.testing.assert_close(shape_operators(*cube(), sine=False), expected)


def test_tube_bends_across_its_axis_and_the_matrix_points_along_it():
    """A tube bends round its axis; in the normal cycle that curvature sits in the direction of the axis."""
    vertices, topology = capped_prism(64, radius=2.0, height=3.0)
    matrices = shape_operators(vertices, topology, sine=False)
    lateral = 2 * math.pi / 64 * 3 / 2  # half of length 3 times angle
    torch.testing.assert_close(matrices[:, 2, 2], torch.full((128,), lateral, dtype=DOUBLE))
    assert matrices[:, 2, :2].abs().max() < 1e-12


def test_on_the_sphere_the_nuclear_norms_sum_to_eight_pi_and_angles_are_the_better_choice():
    errors = {True: [], False: []}
    for level in (2, 3):
        vertices, topology = icosphere(level)
        for sine in (True, False):
            total = torch.linalg.svdvals(shape_operators(vertices, topology, sine=sine)).sum()
            errors[sine].append(abs(total.item() - 8 * math.pi))
    for sine in (True, False):
        assert math.log2(errors[sine][0] / errors[sine][1]) > 1.9
    assert errors[False][-1] < 0.7 * errors[True][-1]


@pytest.mark.parametrize("sine", [True, False])
def test_smooth_at_flat_edges(sine):
    vertices, topology = flat_pair()

    def operators(points: torch.Tensor) -> torch.Tensor:
        return shape_operators(points, topology, sine=sine)

    assert not operators(vertices).any()
    assert torch.autograd.gradcheck(operators, vertices.clone().requires_grad_(), check_forward_ad=True)
    jacobian = torch.func.jacrev(operators)(vertices)
    assert jacobian[0, 0, 0, 2, 2].item() == pytest.approx(-1)  # lifting a tip of height 1: 1/2 l da, l = 2, da = -1


@pytest.mark.parametrize("sine", [True, False])
def test_degenerate_faces_add_nothing(sine):
    vertices, topology = collinear_face()
    matrices = shape_operators(vertices, topology, sine=sine)
    assert matrices[:2].flatten(1).any(1).all()  # ends of the one edge between two good faces
    assert not matrices[2:].any()
