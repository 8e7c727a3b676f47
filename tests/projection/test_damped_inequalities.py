"""Damped steps among inequalities: damping belongs to what a step minimises, also after walls were met on the way."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, OneSided, ProjectionSettings, guided_projection


def place(x: Tensor, target: Tensor) -> Tensor:
    return x[0] - target


def beyond(x: Tensor, normal: Tensor, offset: Tensor) -> Tensor:
    return torch.dot(normal, x[0]) - offset


def one_step(normals: Tensor, offsets: Tensor, target: Tensor, weight: float, damping: float) -> Tensor:
    """Where a point goes from 0 towards a target in one step, with walls ``normal . x <= offset``."""
    rows = torch.zeros(normals.shape[0], 1, dtype=torch.int64)
    terms = [
        ElementTerm("target", place, [("x", rows[:1])], data=(target[None],), linear=True),
        ElementTerm("walls", beyond, [("x", rows)], data=(normals, offsets), weight=weight, loss=OneSided()),
    ]
    settings = ProjectionSettings(
        initial_damping=damping, damping_scale="identity", solver="dense", max_iterations=1, least_extrapolation=100.0
    )
    return guided_projection({"x": torch.zeros(1, 2, dtype=DOUBLE)}, terms, settings=settings).blocks["x"][0]


@pytest.mark.parametrize("damping", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("steepness", [2.0, 3.0])
def test_a_step_across_two_walls_is_the_damped_minimum_of_each_coordinate(steepness: float, damping: float) -> None:
    """Walls x <= 1 and steepness y <= 0 do not know of each other, and neither do target and damping.

    The way to the target meets one wall first and turns there, so later parts of the step do not start at 0, where
    the damping has no slope of its own.
    """
    normals = torch.tensor([[1.0, 0.0], [0.0, steepness]], dtype=DOUBLE)
    offsets = torch.tensor([1.0, 0.0], dtype=DOUBLE)
    target = torch.tensor([3.0, 3.0], dtype=DOUBLE)
    step = one_step(normals, offsets, target, 1.0, damping)
    # (x - 3) + (x - 1) + damping x = 0 and (y - 3) + steepness^2 y + damping y = 0
    expected = [4.0 / (2.0 + damping), 3.0 / (1.0 + steepness**2 + damping)]
    assert step.tolist() == pytest.approx(expected, rel=1e-9)


def test_a_step_across_two_slanted_walls_is_the_damped_minimum() -> None:
    """There the gradient of the damped model, with both walls felt, vanishes."""
    normals = torch.tensor([[2.0, -1.0], [-1.0, 2.0]], dtype=DOUBLE)
    offsets = torch.tensor([1.0, 1.0], dtype=DOUBLE)
    target = torch.tensor([5.0, 3.0], dtype=DOUBLE)
    step = one_step(normals, offsets, target, 4.0, 1.0)
    misses = normals @ step - offsets
    assert bool((misses > 0.0).all())
    slope = (step - target) + 4.0 * normals.T @ misses + step
    assert float(slope.abs().max()) < 1e-9
