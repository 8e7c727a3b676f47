from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import (
    capped_prism,
    flat_squares,
    icosphere,
    random_polytope,
    split_faces,
    torus,
    with_isolated,
)
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.geometry import angle_defects, corner_angles


def l_shape() -> tuple[torch.Tensor, Topology]:
    """A hexagon with one reflex corner and the square that fills its notch, planar."""
    points = [[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0], [2, 2, 0]]
    return torch.tensor(points, dtype=DOUBLE), Topology.from_faces([[0, 1, 2, 3, 4, 5], [3, 2, 6, 4]])


def test_right_and_regular_angles():
    torch.testing.assert_close(corner_angles(*cube()), torch.full((24,), math.pi / 2, dtype=DOUBLE))
    torch.testing.assert_close(corner_angles(*tetrahedron()), torch.full((12,), math.pi / 3, dtype=DOUBLE))


def test_angles_of_triangles_sum_to_pi_and_follow_the_law_of_cosines():
    vertices, topology = wavy_grid(4, 4, triangles=True)
    angles = corner_angles(vertices, topology).view(-1, 3)
    torch.testing.assert_close(angles.sum(1), torch.full((topology.num_faces,), math.pi, dtype=DOUBLE))
    for face, row in zip(topology.face_lists(), angles, strict=True):
        for k in range(3):
            p, q, r = (vertices[face[(k + j) % 3]] for j in range(3))
            a, b, c = (q - r).norm(), (p - q).norm(), (p - r).norm()
            torch.testing.assert_close(row[k], torch.acos((b**2 + c**2 - a**2) / (2 * b * c)))


@pytest.mark.parametrize("turn", [False, True])
def test_reflex_corners_of_polygons_exceed_pi(turn):
    vertices, topology = l_shape()
    if turn:
        vertices = vertices @ random_rotation(1).T
    expected = torch.tensor([1, 1, 1, 3, 1, 1, 1, 1, 1, 1], dtype=DOUBLE) * math.pi / 2
    torch.testing.assert_close(corner_angles(vertices, topology), expected)
    assert torch.autograd.gradcheck(lambda v: corner_angles(v, topology), vertices.clone().requires_grad_())


@pytest.mark.parametrize("turn", [False, True])
def test_reflex_corners_of_quads_exceed_pi(turn):
    """An arrowhead: half a square whose diagonal is pushed in to a fourth of the way."""
    vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]], dtype=DOUBLE)
    if turn:
        vertices = vertices @ random_rotation(1).T
    thin = math.atan(1 / 3)
    expected = torch.tensor([math.pi / 2, thin, 1.5 * math.pi - 2 * thin, thin], dtype=DOUBLE)
    for start in range(4):
        topology = Topology.from_faces([[(start + k) % 4 for k in range(4)]])
        torch.testing.assert_close(corner_angles(vertices, topology), expected.roll(-start))


def test_straight_and_folded_corners_and_corners_without_angle():
    topology = Topology.from_faces([[0, 1, 2]])
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]], dtype=DOUBLE)
    assert corner_angles(line, topology).tolist() == pytest.approx([0, math.pi, 0])
    assert corner_angles(line[[0, 0, 1]], topology).tolist() == [0.0, 0.0, 0.0]
    for vertices in (line, line[[0, 0, 1]]):
        assert not torch.func.jacrev(corner_angles)(vertices, topology).any()


def test_triangles_have_no_reflex_corners_even_where_rounding_turns_them_over():
    points = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [3, 0, 0]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2, 3], [1, 0, 4]])  # the triangle has no area
    for seed in range(20):
        angles = corner_angles(points @ random_rotation(seed).T, topology)[4:]
        torch.testing.assert_close(angles, torch.tensor([math.pi, 0, 0], dtype=DOUBLE), rtol=0, atol=1e-7)


CLOSED = {
    "cube": (cube, 2),
    "split cube": (lambda: split_faces(cube()), 2),
    "prism": (lambda: capped_prism(7), 2),
    "sphere": (lambda: icosphere(2), 2),
    "polytope": (lambda: random_polytope(0), 2),
    "torus": (lambda: split_faces(torus()), 0),
}
BOUNDED = {
    "triangle": (lambda: (cube()[0][:3], Topology.from_faces([[0, 1, 2]])), 1),
    "disk": (lambda: wavy_grid(5, 4, triangles=True), 1),
    "squares": (flat_squares, 1),
    "notch": (l_shape, 1),
    "open tube": (lambda: (capped_prism(6)[0], Topology.from_faces(capped_prism(6)[1].face_lists()[:-2])), 0),
    "disk and isolated vertex": (lambda: with_isolated(wavy_grid(4, 4, triangles=True)), 1),
    "two disks": (
        lambda: (
            torch.cat([flat_squares()[0], 2 * flat_squares()[0]]),
            Topology.from_faces([[v + k for v in face] for k in (0, 6) for face in flat_squares()[1].face_lists()]),
        ),
        2,
    ),
}


@pytest.mark.parametrize(("mesh", "characteristic"), (CLOSED | BOUNDED).values(), ids=(CLOSED | BOUNDED).keys())
def test_gauss_bonnet(mesh, characteristic):
    vertices, topology = mesh()
    used = int((topology.valences > 0).sum())
    assert used - topology.num_edges + topology.num_faces == characteristic
    total = angle_defects(vertices, topology).sum().item()
    assert total == pytest.approx(2 * math.pi * characteristic, abs=1e-12)


def test_defects_of_known_vertices():
    torch.testing.assert_close(angle_defects(*cube()), torch.full((8,), math.pi / 2, dtype=DOUBLE))
    torch.testing.assert_close(angle_defects(*tetrahedron()), torch.full((4,), math.pi, dtype=DOUBLE))
    expected = torch.tensor([0, 0, 1, 1, 1, 1], dtype=DOUBLE) * math.pi / 2  # the corners of a 1 x 2 rectangle
    torch.testing.assert_close(angle_defects(*flat_squares()), expected)


def test_a_saddle_has_negative_defect():
    ring = [[math.cos(k * math.pi / 3), math.sin(k * math.pi / 3), 0.5 * (-1) ** k] for k in range(6)]
    topology = Topology.from_faces([[6, k, (k + 1) % 6] for k in range(6)])
    vertices = torch.tensor([*ring, [0.0, 0, 0]], dtype=DOUBLE)
    assert angle_defects(vertices, topology)[6] < -0.1
    assert angle_defects(vertices * torch.tensor([1.0, 1, 0]), topology)[6].item() == pytest.approx(0)


def test_defect_of_a_non_planar_face_is_what_gauss_bonnet_lacks():
    vertices, topology = wavy_grid(4, 4)
    lacking = (topology.face_sizes - 2) * math.pi
    lacking = lacking.to(DOUBLE).index_add(0, topology.corner_faces, -corner_angles(vertices, topology))
    total = angle_defects(vertices, topology).sum() - lacking.sum()
    assert lacking.abs().max() > 1e-3
    assert total.item() == pytest.approx(2 * math.pi)
