"""Polygons as surfaces: fans around the mean of the corners, and diagonals where that does not fill the face."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from helpers import DOUBLE, random_rotation

from torchfair import Topology
from torchfair.geometry.closest_point import ReferenceSurface


def test_a_skew_quad_passes_through_the_mean_of_its_corners():
    vertices = torch.tensor([[0.0, 0, 1], [1, 0, 0], [1, 1, 1], [0, 1, 0]], dtype=DOUBLE)
    for shift in range(4):
        surface = ReferenceSurface(vertices, Topology.from_faces([np.roll([0, 1, 2, 3], shift)]))
        assert surface.closest(torch.full((1, 3), 0.5, dtype=DOUBLE)).distances.item() == 0


@pytest.mark.parametrize("start", range(6))
@pytest.mark.parametrize("flip", [False, True])
def test_a_polygon_that_is_not_convex_does_not_fill_its_notch(start, flip):
    """An L of two arms of width 1 and length 10: the mean of its corners lies outside."""
    corners = [[0.0, 0, 0], [10, 0, 0], [10, 1, 0], [1, 1, 0], [1, 10, 0], [0, 10, 0]]
    order = np.roll(np.arange(6), start)[:: -1 if flip else 1]
    turn = random_rotation(7)
    surface = ReferenceSurface(torch.tensor(corners, dtype=DOUBLE) @ turn.T, Topology.from_faces([order]))
    points = torch.tensor([[4.0, 5, 0], [5, 3, 0], [0.5, 8, 2], [7, 0.2, 0]], dtype=DOUBLE) @ turn.T
    assert surface.closest(points).distances.tolist() == pytest.approx([3, 2, 2, 0], abs=1e-14)
    area = torch.linalg.cross(
        *(surface.points[surface.pieces[:, k]] - surface.points[surface.pieces[:, 0]] for k in (1, 2))
    )
    assert area.norm(dim=1).sum().item() / 2 == pytest.approx(19)


@pytest.mark.parametrize("corners", [[[0, 0], [1, 0], [2, 0], [3, 0]], [[0, 0], [2, 2], [2, 0], [0, 2]], [[1, 1]] * 5])
def test_polygons_without_area_or_crossing_themselves_are_still_measured(corners):
    vertices = torch.tensor([[*corner, 1] for corner in corners], dtype=DOUBLE)
    surface = ReferenceSurface(vertices, Topology.from_faces([range(len(corners))]))
    assert surface.closest(vertices).distances.max() == 0
    far = torch.tensor([[1.0, 1, 9]], dtype=DOUBLE)
    assert 8 <= surface.closest(far).distances.item() <= math.hypot(8, 1)
