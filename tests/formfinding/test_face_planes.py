"""Where the planes of faces meet."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, grid_faces
from honeycombs import honeycomb

from torchfair import Topology
from torchfair.formfinding.fair.face_planes import on_face_planes
from torchfair.geometry import edge_lengths, face_normals
from torchfair.geometry.planarity import planarity


def all_faces(topology: Topology) -> torch.Tensor:
    return torch.arange(topology.num_faces)


@pytest.mark.parametrize("amplitude", [0.03, 0.12, -0.12])
def test_hexagons_that_meet_in_threes_are_planar_there_and_none_collapses(amplitude: float) -> None:
    vertices, topology = honeycomb(amplitude)
    placed = on_face_planes(vertices, topology, all_faces(topology))
    assert float(planarity(vertices, topology).max()) > 0.3 * abs(amplitude)
    assert float(planarity(placed, topology).max()) < 1e-12
    assert float(edge_lengths(placed, topology).min()) > 0.7
    assert bool(((face_normals(placed, topology) * face_normals(vertices, topology)).sum(1) > 0.9).all())


def test_the_hexagon_in_the_middle_is_that_of_the_tangent_planes_of_the_saddle() -> None:
    """Those at ``3^(1/2) (cos t, sin t)`` meet z = 0 in ``cos t x - sin t y = 3^(1/2) / 2 cos 2t``."""
    vertices, topology = honeycomb(0.12)
    placed = on_face_planes(vertices, topology, all_faces(topology))
    middle = min(topology.face_lists(), key=lambda face: float(vertices[face].norm(dim=1).max()))
    wide = math.sqrt(0.75)
    expected = [(-wide, -1, 0), (-wide, 1, 0), (0, -0.5, 0), (0, 0.5, 0), (wide, -1, 0), (wide, 1, 0)]
    found = sorted(placed[middle].tolist(), key=lambda place: (round(place[0], 6), place[1]))
    torch.testing.assert_close(torch.tensor(found), torch.tensor(expected), rtol=0, atol=1e-6)


def test_planar_faces_stay_and_only_chosen_ones_count() -> None:
    x, y = torch.meshgrid(*(torch.arange(4, dtype=DOUBLE),) * 2, indexing="ij")
    flat = torch.stack([x, y, 0.0 * x], -1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(4, 4))
    torch.testing.assert_close(on_face_planes(flat, topology, all_faces(topology)), flat, rtol=0, atol=1e-14)
    bent = flat.clone()
    bent[5, 2] = 0.2
    assert torch.equal(on_face_planes(bent, topology, all_faces(topology)[:0]), bent)
    moved = on_face_planes(bent, topology, torch.tensor([0])) - bent
    assert sorted(torch.nonzero(moved.norm(dim=1) > 1e-9).squeeze(1).tolist()) == sorted(topology.face_lists()[0])


@pytest.mark.parametrize(("noise", "staying"), [(1e-3, 1), (1e-2, 1), (1e-6, 0)])
def test_planes_that_are_nearly_parallel_move_nothing_far(noise: float, staying: int) -> None:
    """Of a flat honeycomb with noise; the places of those that would go farther than an edge are kept."""
    vertices, topology = honeycomb(0.0)
    vertices = vertices + noise * torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    moves = (on_face_planes(vertices, topology, all_faces(topology)) - vertices).norm(dim=1)
    assert float(moves.max()) < 1.0
    assert int((moves == 0).sum()) == staying
