"""Reflection variation seen from a point against quadrature, its limit far away, and solid angles."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from geometry_meshes import GENERIC, collinear_face, flat_pair, icosphere, random_polytope
from helpers import DOUBLE, cube, random_rotation, wavy_grid

from torchfair import ShapeError, Topology
from torchfair.geometry import dihedral_angles, face_normals
from torchfair.reflection import (
    reflection_variation,
    reflection_variation_from_eyes,
    reflection_variation_from_eyes_per_edge,
    solid_angles,
)

EYES = torch.tensor([[0.5, 1.0, 6.0], [3.0, -2.0, 4.0], [-4.0, 2.5, 1.0]], dtype=DOUBLE)


def test_equals_quadrature_of_the_jump_along_the_arc_in_the_sphere_of_views():
    vertices, topology = wavy_grid(5, 4, triangles=True)
    normals = face_normals(vertices, topology)
    left, right = normals[topology.interior_edge_faces].unbind(1)
    v, w = vertices[topology.interior_edges].unbind(1)
    nodes, weights = (torch.from_numpy(x) for x in np.polynomial.legendre.leggauss(40))
    terms = reflection_variation_from_eyes_per_edge(vertices, topology, EYES)
    for eye, row in zip(EYES, terms, strict=True):
        t = (nodes[:, None, None] + 1) / 2
        x = v + t * (w - v) - eye
        distance = x.norm(dim=-1, keepdim=True)
        d = x / distance
        r, s = (d - 2 * (d * n).sum(-1, keepdim=True) * n for n in (left, right))
        speed = ((w - v) - ((w - v) * d).sum(-1, keepdim=True) * d) / distance  # of d along the edge
        jumps = (r - s).norm(dim=-1) * speed.norm(dim=-1)
        torch.testing.assert_close(row, (jumps * weights[:, None]).sum(0) / 2, rtol=1e-9, atol=1e-12)


def test_equals_the_formula_with_unit_vectors_to_the_ends():
    vertices, topology = random_polytope(2)
    v, w = vertices[topology.interior_edges].unbind(1)
    e = torch.nn.functional.normalize(w - v, dim=-1)
    d0, d1 = (torch.nn.functional.normalize(x - EYES[0], dim=-1) for x in (v, w))
    expected = 2 * dihedral_angles(vertices, topology).sin().abs() * (e * (d1 - d0)).sum(-1)
    torch.testing.assert_close(reflection_variation_from_eyes_per_edge(vertices, topology, EYES[:1])[0], expected)


def test_tends_to_the_distant_form_with_first_order():
    vertices, topology = wavy_grid(triangles=True)
    view = EYES / EYES.norm(dim=-1, keepdim=True)
    distant = reflection_variation(vertices, topology, view)
    errors = []
    for distance in (1e2, 1e3, 1e4, 1e5):
        value = distance * reflection_variation_from_eyes(vertices, topology, distance * view)
        errors.append(((value - distant).abs() / distant).max().item())
    assert all(fine < 0.15 * coarse for coarse, fine in itertools.pairwise(errors))
    assert errors[-1] < 1e-4


def test_smooth_part_is_that_of_one_plane_mirror():
    """|grad r|^2 = 2 on the sphere of viewing directions, for any plane: sqrt 2 per solid angle."""
    normal = random_rotation(1)[0]
    d = torch.nn.functional.normalize(torch.tensor([0.2, 0.5, -1], dtype=DOUBLE), dim=0)
    jacobian = torch.func.jacfwd(lambda x: (x / x.norm()) - 2 * (x / x.norm() @ normal) * normal)(d)
    assert jacobian.norm().item() == pytest.approx(math.sqrt(2), rel=1e-12)


def test_unchanged_by_motions_and_scaling_together_with_the_eye():
    vertices, topology = GENERIC["mixed"]()
    turn = random_rotation(5)
    value = reflection_variation_from_eyes(vertices, topology, EYES)
    moved = reflection_variation_from_eyes(2 * vertices @ turn.T - 3, topology, 2 * EYES @ turn.T - 3)
    torch.testing.assert_close(moved, value)


@pytest.mark.parametrize("mesh", [lambda: wavy_grid(3, 3, triangles=True), lambda: wavy_grid(3, 3)])
def test_gradcheck(mesh):
    vertices, topology = mesh()
    inputs = (vertices.requires_grad_(), EYES[:2].clone().requires_grad_())
    function = lambda v, o: reflection_variation_from_eyes(v, topology, o)  # noqa: E731
    assert torch.autograd.gradcheck(function, inputs, check_forward_ad=True)
    assert torch.autograd.gradgradcheck(function, inputs)


@pytest.mark.parametrize("mesh", [flat_pair, collinear_face])
def test_finite_on_flat_and_degenerate_meshes_and_for_eyes_in_line_with_or_on_an_edge(mesh):
    vertices, topology = mesh()
    v, w = vertices[topology.interior_edges[0]]
    eyes = torch.stack([2 * w - v, 0.5 * (v + w), v, EYES[0]])
    function = lambda x: reflection_variation_from_eyes_per_edge(x, topology, eyes)  # noqa: E731
    terms = function(vertices)
    assert not terms[:3, 0].any()
    assert torch.isfinite(terms).all()
    for derivative in (torch.func.jacrev, torch.func.jacfwd):
        assert torch.isfinite(derivative(function)(vertices)).all()
    if mesh is flat_pair:
        assert not terms.any()


@pytest.mark.parametrize("mesh", [cube, lambda: icosphere(1), lambda: random_polytope(7)])
def test_solid_angles_of_closed_surfaces_are_four_pi_inside_and_zero_outside(mesh):
    vertices, topology = mesh()
    eyes = torch.stack([vertices.mean(0), vertices.mean(0) + 0.05, vertices.mean(0) + 9])
    total = solid_angles(vertices, topology, eyes).sum(-1)
    torch.testing.assert_close(total, total.new_tensor([4 * math.pi, 4 * math.pi, 0]), rtol=1e-12, atol=1e-12)


def test_solid_angle_of_faces_of_a_cube_in_the_order_of_the_faces():
    vertices, topology = cube()
    faces = [t for a, b, c, d in topology.face_lists()[::2] for t in ([a, b, c], [a, c, d])]
    mixed = Topology.from_faces(faces[:1] + topology.face_lists()[1::2] + faces[1:])
    angles = solid_angles(vertices, mixed, torch.full((1, 3), 0.5, dtype=DOUBLE))[0]
    sizes = mixed.face_sizes
    torch.testing.assert_close(angles, torch.where(sizes == 4, 2 / 3 * math.pi, 1 / 3 * math.pi).to(DOUBLE))
    assert not solid_angles(vertices, topology, vertices[:1])[0, [0, 2, 4]].any()  # faces through the eye


def test_wrong_eyes_are_named():
    vertices, topology = wavy_grid()
    with pytest.raises(ShapeError, match="eyes"):
        reflection_variation_from_eyes(vertices, topology, torch.ones(3))
