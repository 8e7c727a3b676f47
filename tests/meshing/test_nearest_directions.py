"""Principal directions that edges are nearest to."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from torchfair.geometry import face_centres
from torchfair.meshing import principal_quads
from torchfair.meshing.nearest_directions import NearestDirections
from torchfair.shapes import Cylinder, builtin_mesh, irregular_triangles


@pytest.fixture(scope="module")
def tube() -> tuple[Tensor, NearestDirections, Tensor]:
    """Middles of faces of a cylinder about the z axis, what gives directions there, and unit normals."""
    made = irregular_triangles(Cylinder(), 600)
    mesh = principal_quads(made.vertices, made.topology, count=100)
    middles = face_centres(made.vertices, made.topology)
    middles = middles[middles[:, 2].abs() < 0.5 * float(made.vertices[:, 2].abs().max())]
    normals = torch.nn.functional.normalize(middles * middles.new_tensor([1.0, 1.0, 0.0]), dim=1)
    return middles, NearestDirections(mesh.surface, mesh.report["spacing"]), normals


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("angle", [-0.15, 0.1])
def test_edges_near_a_direction_are_given_it_to_the_same_side(tube, quarters, angle):
    """Axis and circles of a cylinder, from either end."""
    middles, directions, normals = tube
    axis = torch.zeros_like(middles)
    axis[:, 2] = 1.0
    across = torch.linalg.cross(normals, axis)

    def at(turn: float) -> Tensor:
        return math.cos(turn) * axis + math.sin(turn) * across

    found = directions(middles, 0.3 * at(quarters * math.pi / 2 + angle))
    right = (found * at(quarters * math.pi / 2)).sum(1)
    torch.testing.assert_close(torch.linalg.vector_norm(found, dim=1), torch.ones(len(found)).double())
    assert float(right.min()) > math.cos(0.09)  # triangles lie aslant
    assert float(right.mean()) > math.cos(0.03)


def test_edges_between_directions_are_given_none(tube):
    middles, directions, normals = tube
    axis = torch.zeros_like(middles)
    axis[:, 2] = 1.0
    between = math.cos(0.3) * axis + math.sin(0.3) * torch.linalg.cross(normals, axis)
    assert not directions(middles, between).any()


def test_where_there_is_no_direction_edges_are_given_none():
    surface = builtin_mesh("sphere")
    mesh = principal_quads(*surface, count=100)
    middles = surface[0][:50]
    along = torch.linalg.cross(middles, middles.new_tensor([[0.0, 0.0, 1.0]]).expand_as(middles))
    assert not NearestDirections(mesh.surface, mesh.report["spacing"])(middles, along).any()
