"""Limitations of the paper: surfaces of least C have cone points at fixed points; rounding them hardly matters."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.curves import ClosedCurve
from torchfair.energies import total_absolute_curvature
from torchfair.formfinding import minimise_absolute_curvature, start_surface
from torchfair.shapes import Cone, Sphere

HEIGHT = 0.5


def rounded_cone(radius: float) -> float:
    """C of a cone of height 1/2 over the unit circle whose tip is a piece of a sphere."""
    tilt = math.atan(HEIGHT)  # of the cone against the ground
    wide, low = radius * math.sin(tilt), HEIGHT - radius * math.sin(tilt) * HEIGHT  # where both touch
    frustum = Cone(1.0, wide, low).total_absolute_curvature()
    return frustum + Sphere(radius, (math.pi / 2 - tilt, math.pi / 2)).total_absolute_curvature()


def test_rounding_the_tip_of_a_cone_changes_c_in_proportion_to_the_radius() -> None:
    cone = 2 * math.pi * HEIGHT
    rates = [(rounded_cone(radius) - cone) / radius for radius in (0.1, 0.01, 0.001)]
    assert rates == pytest.approx([rates[0]] * 3)
    assert abs(rates[0]) < 0.1  # 4 pi (1 - cos) of the piece of a sphere, less what is missing of the cone


def test_a_bulge_pulled_at_one_point_becomes_a_cone() -> None:
    turn = torch.arange(48, dtype=DOUBLE) * 2 * math.pi / 48
    circle = ClosedCurve(torch.stack([turn.cos(), turn.sin(), 0 * turn], 1))
    vertices, topology = start_surface([circle], 300)
    apex = int(torch.linalg.vector_norm(vertices, dim=1).argmin())
    bulge = vertices.clone()
    bulge[:, 2] = HEIGHT * (1 - vertices[:, :2].square().sum(1))

    def from_cone(points: Tensor) -> float:
        return float((points[:, 2] - HEIGHT * (1 - torch.hypot(points[:, 0], points[:, 1]))).abs().max())

    found = [
        minimise_absolute_curvature(bulge, topology, handles={apex: (0.0, 0.0, HEIGHT)}, curves=[circle], levels=levels)
        for levels in (0, 1)
    ]
    distances = [from_cone(result.vertices) for result in found]
    assert from_cone(bulge) > 0.1
    assert distances[0] < 0.006
    assert distances[1] < 0.7 * distances[0]
    value = total_absolute_curvature(found[1].vertices, found[1].topology, boundary="extrapolated").item()
    assert value == pytest.approx(2 * math.pi * HEIGHT, rel=0.02)
