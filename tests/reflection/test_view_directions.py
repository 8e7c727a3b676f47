"""Sets of view directions."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from reflection_tools import vector

from torchfair import ShapeError, TorchfairError
from torchfair.reflection import axis_directions, cone_directions, ring_directions

AXIS = vector(0.3, -2, 1)


def test_axis_directions_are_a_two_design() -> None:
    """Means of 1, d and d d^T over them are those over the sphere."""
    for rotation in (None, random_rotation(1)):
        directions = axis_directions(rotation)
        assert torch.allclose(directions.mean(0), torch.zeros(3, dtype=DOUBLE), atol=1e-15)
        assert torch.allclose(directions.T @ directions / 6, torch.eye(3, dtype=DOUBLE) / 3, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 180.0])
def test_cone_reaches_from_its_axis_to_its_rim(angle: float) -> None:
    directions = cone_directions(AXIS, angle, 40)
    axis = AXIS / torch.linalg.vector_norm(AXIS)
    turned = torch.atan2(
        torch.linalg.vector_norm(torch.linalg.cross(directions, axis.expand(40, 3)), dim=-1), directions @ axis
    )
    assert torch.allclose(torch.linalg.vector_norm(directions, dim=-1), torch.ones(40, dtype=DOUBLE))
    assert torch.allclose(directions[0], axis)
    assert bool((turned.diff() > -1e-7).all())
    assert float(turned[-1]) == pytest.approx(math.radians(angle), abs=1e-7)


def test_cone_is_spread_evenly() -> None:
    """Every fifth of the area of a cap holds a fifth of many directions, and their mean lies on the axis."""
    directions = cone_directions(vector(0, 0, 1), 60, 1000)
    shares = torch.histc((1 - directions[:, 2]) / 0.5, 5, 0, 1)
    assert torch.allclose(shares, torch.full((5,), 200.0, dtype=DOUBLE), atol=2)
    assert torch.allclose(directions.mean(0), vector(0, 0, 0.75), atol=2e-3)


def test_ring_turns_about_its_axis_and_looks_down_by_the_elevation() -> None:
    directions = ring_directions(AXIS, 25.0, 12)
    axis = AXIS / torch.linalg.vector_norm(AXIS)
    assert torch.allclose(directions @ axis, torch.full((12,), -math.sin(math.radians(25)), dtype=DOUBLE))
    neighbours = (directions * directions.roll(1, 0)).sum(-1)
    assert torch.allclose(neighbours, neighbours[0].expand(12))
    assert torch.allclose(directions.sum(0) / 12, -math.sin(math.radians(25)) * axis)
    assert torch.allclose(torch.linalg.vector_norm(directions, dim=-1), torch.ones(12, dtype=DOUBLE))


def test_one_direction() -> None:
    assert torch.allclose(cone_directions(AXIS, 40, 1)[0], AXIS / torch.linalg.vector_norm(AXIS))
    assert ring_directions(AXIS, 0, 1).shape == (1, 3)


@pytest.mark.parametrize("directions", [cone_directions, ring_directions])
def test_refusals(directions) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ShapeError, match="axis"):
        directions(torch.zeros(2, 3), 10, 3)
    with pytest.raises(ShapeError, match="count"):
        directions(AXIS, 10, 0)
    with pytest.raises(TorchfairError, match="axis must be"):
        directions(torch.zeros(3), 10, 3)
    with pytest.raises(TorchfairError, match="degrees"):
        directions(AXIS, 200, 3)
