from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.geometry import face_area_vectors
from torchfair.viewing.view_direction import view_direction


def flipped(topology: Topology) -> Topology:
    return Topology.from_faces([face[::-1] for face in topology.face_lists()], topology.num_vertices)


def rolled(vertices: torch.Tensor, shift: int) -> torch.Tensor:
    """Coordinates renamed, z becoming another axis."""
    return vertices.roll(shift, dims=1)


def test_roof_is_seen_from_above_whichever_way_it_is_oriented() -> None:
    vertices, topology = wavy_grid()
    for mesh in (topology, flipped(topology)):
        eye, up = view_direction(vertices, mesh)
        assert torch.equal(up, torch.tensor([0.0, 0, 1], dtype=DOUBLE))
        assert 0.4 < float(eye[2]) < 0.8


def test_y_can_be_up_but_x_cannot() -> None:
    vertices, topology = wavy_grid()
    assert view_direction(rolled(vertices, 2), topology).up.tolist() == [0, 1, 0]
    assert view_direction(rolled(vertices, 1), topology).up.tolist() == [0, 0, 1]


def test_the_long_side_faces_the_eye() -> None:
    vertices, topology = wavy_grid(12, 4)
    eye, _ = view_direction(vertices, topology)
    assert abs(float(eye[1])) > abs(float(eye[0])) > 0.2


def test_most_of_the_surface_shows_one_side() -> None:
    """A curved slope is seen from the side to which it falls; from the other side its steep part shows its back."""
    angle = torch.linspace(torch.pi / 8, torch.pi / 2, 9, dtype=DOUBLE)
    points = torch.stack([angle.cos(), angle.sin()], dim=1)
    x = torch.arange(5, dtype=DOUBLE)[:, None, None].expand(5, 9, 1) / 2
    vertices = torch.cat([x, points.expand(5, 9, 2)], dim=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(5, 9))
    eye, _ = view_direction(vertices, topology)
    facing = face_area_vectors(vertices, topology) @ eye
    assert eye[1] > 0
    assert facing.sum().abs() > 0.95 * facing.abs().sum()


@pytest.mark.parametrize("mesh", [cube(), tetrahedron()])
def test_closed_bodies_stand_on_the_ground(mesh: tuple[torch.Tensor, Topology]) -> None:
    eye, up = view_direction(*mesh)
    assert up.tolist() == [0, 0, 1]
    assert torch.linalg.vector_norm(eye) == pytest.approx(1)


def test_flat_closed_body_lies_down() -> None:
    vertices, topology = cube()
    eye, up = view_direction(vertices * torch.tensor([3.0, 0.5, 4], dtype=DOUBLE), topology)
    assert up.tolist() == [0, 1, 0]
    assert eye[1] > 0.4


def test_far_and_tilted_up_is_not_snapped() -> None:
    vertices, topology = wavy_grid()
    turn = torch.tensor([[1.0, 0, 0], [0, 0.7071, -0.7071], [0, 0.7071, 0.7071]], dtype=DOUBLE)
    up = view_direction(vertices @ turn.T, topology).up
    assert torch.linalg.vector_norm(up) == pytest.approx(1)
    assert 0.5 < float(up[2]) < 0.9


@pytest.mark.parametrize("scale", [0.0, torch.nan, torch.inf])
def test_no_area_gives_some_unit_direction(scale: float) -> None:
    vertices, topology = wavy_grid()
    for points, mesh in ((vertices * scale, topology), (torch.zeros(0, 3), Topology.from_faces([]))):
        eye, up = view_direction(points, mesh)
        assert torch.linalg.vector_norm(eye) == pytest.approx(1)
        assert torch.linalg.vector_norm(up) == pytest.approx(1)
