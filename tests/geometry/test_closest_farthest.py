"""The largest distance of points from a mesh is that of a search for every point, bit for bit, with few searches."""

from __future__ import annotations

import pytest
import torch
from closest_reference import ridge
from geometry_meshes import icosphere
from helpers import DOUBLE, cube, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import _closest_farthest
from torchfair.geometry._closest_farthest import largest_distance
from torchfair.geometry.closest_point import ReferenceSurface

MESHES = [ridge, cube, lambda: wavy_grid(9, 11), lambda: icosphere(2)]


def moved(vertices: Tensor, by: float) -> Tensor:
    return vertices + by * torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("by", [0.0, 1e-9, 0.03, 4.0])
@pytest.mark.parametrize("mesh", MESHES)
def test_it_is_the_largest_of_all_distances_whatever_owners_are_given(mesh, by):
    vertices, topology = mesh()
    points, count = moved(vertices, by), len(vertices)
    expected = float(ReferenceSurface(vertices, topology).closest(points).distances.max())
    assert largest_distance(points, vertices, topology) == expected
    for owners in (torch.arange(count), torch.arange(count).flip(0)):
        assert largest_distance(points, vertices, topology, owners) == expected
    chosen = torch.arange(0, count, 3)
    expected = float(ReferenceSurface(vertices, topology).closest(points[chosen]).distances.max())
    assert largest_distance(points[chosen], vertices, topology, chosen) == expected


def test_owners_without_faces_bound_nothing():
    vertices, topology = wavy_grid(4, 5)
    count = len(vertices)
    isolated = Topology.from_faces([face.tolist() for face in topology.corners.reshape(-1, 4)], count + 1)
    with_one_more = torch.cat([vertices, vertices[:1]])
    points = torch.cat([vertices, torch.tensor([[0.0, 0.0, 9.0]], dtype=DOUBLE)])
    expected = float(ReferenceSurface(vertices, topology).closest(points).distances.max())
    assert largest_distance(points, with_one_more, isolated, torch.arange(count + 1)) == expected > 1.0


def test_of_points_near_their_owners_few_are_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid(60, 60)
    searched: list[int] = []
    search = _closest_farthest.nearest_pieces

    def counted(shape, points):
        searched.append(points.shape[1])
        return search(shape, points)

    monkeypatch.setattr(_closest_farthest, "nearest_pieces", counted)
    points = moved(vertices, 0.02)
    expected = float(ReferenceSurface(vertices, topology).closest(points).distances.max())
    assert largest_distance(points, vertices, topology, torch.arange(len(vertices))) == expected
    assert 0 < sum(searched) < 0.1 * len(vertices)
