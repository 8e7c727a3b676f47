"""Normals of spheres point to where neighbours run counterclockwise; faces with two marked sides take no side."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads

from torchfair import Topology
from torchfair.principal._families import differences, mark, sides_of, spread
from torchfair.principal.spheres import spheres_through


@pytest.mark.parametrize("height", [-0.3, -0.01, 0.01, 0.3])
@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_normals_point_to_where_neighbours_run_counterclockwise(height: float, turn: float) -> None:
    angles = torch.tensor([0.3, 1.4, 3.6, 4.9], dtype=DOUBLE) + turn
    radii = torch.tensor([1.0, 0.9, 1.1, 1.0], dtype=DOUBLE)
    ring = torch.stack([radii * angles.cos(), radii * angles.sin(), height * radii**2], dim=1)
    centre = torch.zeros(3, dtype=DOUBLE)
    found, other = spheres_through(centre, ring), spheres_through(centre, ring.flip(0))
    assert float(found.normals[2]) > 0.8
    assert math.copysign(1.0, float(found.curvatures)) == math.copysign(1.0, height)
    assert float(other.normals[2]) < -0.8
    torch.testing.assert_close(other.curvatures, -found.curvatures)


def test_the_order_of_neighbours_decides_the_side_on_uneven_rings() -> None:
    """An uneven ring whose first three sums of spokes lie clockwise."""
    angles = torch.tensor([2.45, 2.64, 5.59, 5.94], dtype=DOUBLE)
    radii, heights = torch.tensor([[0.5, 0.88, 0.97, 0.51], [-0.48, -1.06, -0.29, -0.57]], dtype=DOUBLE)
    ring = torch.stack([radii * angles.cos(), radii * angles.sin(), heights], dim=1)
    found = spheres_through(torch.zeros(3, dtype=DOUBLE), ring)
    across = torch.linalg.cross(ring[0] - ring[2], ring[1] - ring[3])
    assert float(across @ found.normals) > 0.0


def test_faces_with_two_marked_sides_take_that_of_their_neighbours() -> None:
    rule = differences(Topology.from_faces(split_quads(grid_faces(5, 5))))
    sides = spread(rule, torch.tensor([7]).numpy(), torch.tensor([1]).numpy())
    marked = mark(rule, sides)
    assert (sides_of(rule, marked) == sides).all()
    for edge in (~marked).nonzero()[0]:
        wrong = marked.copy()
        wrong[edge] = True
        assert (sides_of(rule, wrong) == sides).all(), edge
