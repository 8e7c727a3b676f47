from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.geometry.planarity import planarity


def skew_quad(height: float) -> Tensor:
    """Unit-square plan, two opposite corners lifted by ``height``: diagonals at distance ``height``."""
    return torch.tensor([[0.0, 0, 0], [1, 0, height], [1, 1, 0], [0, 1, height]], dtype=DOUBLE)


QUAD = Topology.from_faces([[0, 1, 2, 3]])


def hexagon(lift: float) -> tuple[Tensor, Topology]:
    angles = torch.arange(6, dtype=DOUBLE) * math.pi / 3
    points = torch.stack([angles.cos(), angles.sin(), torch.zeros(6, dtype=DOUBLE)], dim=1)
    points[2, 2] = lift
    return points, Topology.from_faces([list(range(6))])


def naive(vertices: Tensor, topology: Topology) -> Tensor:
    values = []
    for face in topology.face_lists():
        p = [vertices[v] for v in face]
        k = len(p)
        mean = sum(torch.linalg.vector_norm(p[(i + 1) % k] - p[i]) for i in range(k)) / k
        worst = torch.zeros((), dtype=vertices.dtype)
        for i in range(k if k > 3 else 0):
            a, b, c, d = (p[(i + j) % k] for j in range(4))
            normal = torch.linalg.cross(c - a, d - b)
            worst = torch.maximum(worst, (normal @ (b - a)).abs() / torch.linalg.vector_norm(normal))
        values.append(worst / mean)
    return torch.stack(values)


@pytest.mark.parametrize("height", [0.0, 0.25, -0.5])
def test_quad_is_distance_of_diagonals_over_mean_edge(height: float) -> None:
    expected = abs(height) / math.sqrt(1 + height**2)
    assert planarity(skew_quad(height), QUAD).item() == pytest.approx(expected, abs=1e-15)


def test_triangles_and_planar_polygons_are_zero() -> None:
    assert torch.equal(planarity(*tetrahedron()), torch.zeros(4, dtype=DOUBLE))
    assert planarity(*cube()).abs().max() < 1e-15
    assert planarity(*hexagon(0.0)).abs().max() < 1e-15


def test_one_lifted_corner_of_a_hexagon() -> None:
    """Runs with the lifted corner at an end or in the middle; the largest deviation counts."""
    vertices, topology = hexagon(0.1)
    assert torch.allclose(planarity(vertices, topology), naive(vertices, topology), rtol=1e-13)
    assert planarity(vertices, topology).item() > 0.01


def test_mixed_polygons_agree_with_a_loop() -> None:
    vertices, topology = wavy_grid(5, 4)
    faces = topology.face_lists()
    a, b = faces[0][0], faces[0][2]
    split = [[*faces[0][:3]], [a, b, faces[0][3]], *faces[1:]]
    mixed = Topology.from_faces(split, topology.num_vertices)
    assert torch.allclose(planarity(vertices, mixed), naive(vertices, mixed), rtol=1e-12, atol=1e-15)
    assert torch.equal(planarity(vertices, mixed)[:2], torch.zeros(2, dtype=DOUBLE))


def test_invariant_under_motion_and_scaling() -> None:
    vertices, topology = wavy_grid()
    moved = 7.5 * vertices @ random_rotation(3).T + torch.tensor([1.0, -2, 3], dtype=DOUBLE)
    assert torch.allclose(planarity(moved, topology), planarity(vertices, topology), rtol=1e-11)


def test_invariant_under_choice_of_first_corner_and_orientation() -> None:
    vertices, _ = hexagon(0.3)
    vertices[4, 2] = -0.2
    base = planarity(vertices, Topology.from_faces([[0, 1, 2, 3, 4, 5]]))
    for face in ([2, 3, 4, 5, 0, 1], [5, 4, 3, 2, 1, 0]):
        assert torch.allclose(planarity(vertices, Topology.from_faces([face])), base, rtol=1e-13)


def test_batch_equals_loop() -> None:
    vertices, topology = wavy_grid()
    batch = torch.stack([vertices, vertices * torch.tensor([1.0, 1, 2], dtype=DOUBLE)])[None]
    values = planarity(batch, topology)
    assert values.shape == (1, 2, topology.num_faces)
    assert torch.allclose(values[0, 1], planarity(batch[0, 1], topology), rtol=1e-14)


def test_gradcheck_on_skew_polygons() -> None:
    vertices, topology = wavy_grid(3, 3)
    assert torch.autograd.gradcheck(lambda x: planarity(x, topology), vertices.requires_grad_())
    vertices, topology = hexagon(0.1)
    vertices[4, 2] = -0.25
    assert torch.autograd.gradcheck(lambda x: planarity(x, topology), vertices.requires_grad_())


@pytest.mark.parametrize(
    "points",
    [
        [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],  # planar: the kink
        [[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],  # collinear: parallel diagonals
        [[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]],  # crossed quad with parallel diagonals
        [[1.0, 2, 3]] * 4,  # a point
    ],
)
def test_degenerate_quads_are_zero_with_zero_gradient(points: list[list[float]]) -> None:
    vertices = torch.tensor(points, dtype=DOUBLE, requires_grad=True)
    value = planarity(vertices, QUAD)
    (gradient,) = torch.autograd.grad(value.sum(), vertices)
    assert value.item() == 0.0
    assert torch.equal(gradient, torch.zeros_like(gradient))


def test_no_faces_and_wrong_shape() -> None:
    empty = Topology.from_faces([], 3)
    assert planarity(torch.zeros(2, 3, 3), empty).shape == (2, 0)
    with pytest.raises(ShapeError, match="vertices"):
        planarity(torch.zeros(5, 3), QUAD)
