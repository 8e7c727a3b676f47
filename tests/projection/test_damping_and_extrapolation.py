"""How damping follows the gain of steps, and how far steps go on that gain more than the model says."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, ProjectionSettings, guided_projection
from torchfair.projection.damping import Damping
from torchfair.projection.layout import State

STEPS = ProjectionSettings(
    damping_scale="identity",
    solver="dense",
    merit_tolerance=0.0,
    gradient_tolerance=0.0,
    least_uncorrected_gain=-math.inf,  # one trial for a step
)


def place(x: Tensor) -> Tensor:
    return x[0]


def at(x: float) -> dict[str, Tensor]:
    return {"x": torch.full((1, 1), x, dtype=DOUBLE)}


def square() -> ElementTerm:
    return ElementTerm("square", place, [("x", torch.zeros(1, 1, dtype=torch.int64))])


# ---- damping -----------------------------------------------------------------------------------------------


def test_damping_falls_to_a_third_with_every_step_that_does_what_the_model_says() -> None:
    """On a square the model is the merit: gains are 1, and the step divides x by 1 + 1 / damping."""
    result = guided_projection(at(5.0), [square()], settings=replace(STEPS, initial_damping=81.0, max_iterations=6))
    expected, x = [], 5.0
    for record in result.history[1:]:
        assert record.accepted
        assert record.gain == pytest.approx(1.0)
        expected.append(81.0 / 3.0 ** len(expected))
        x *= expected[-1] / (1.0 + expected[-1])
        assert record.merit == pytest.approx(0.5 * x * x)
    assert [record.damping for record in result.history[1:]] == pytest.approx(expected)


def test_damping_rises_by_what_a_step_overshot() -> None:
    """A merit that rises by 400 times what was promised to fall: the best step is far shorter than half."""
    damping = Damping(0.1, growth=2.0)
    assert damping.rejected(-400.0).value == pytest.approx(4.0)
    assert damping.rejected(-400.0).growth == damping.rejected().growth == 4.0
    assert damping.rejected(-1e30).value == pytest.approx(1e3)
    assert damping.shortened(2).value == pytest.approx(1.6)
    for gain in (0.0, -1.0, -9.0, -math.inf, math.nan):
        assert damping.rejected(gain).value == pytest.approx(0.2)
    assert Damping(0.1, growth=1024.0).rejected(-400.0).value == pytest.approx(102.4)


def test_far_overshooting_steps_are_given_up_after_few() -> None:
    """A wall behind which the residual grows as a square, on the way to a far aim: doublings take seven refusals."""

    def wall(x: Tensor) -> Tensor:
        return torch.stack([x[0, 0] - 1.0, 1e4 * torch.relu(x[0, 0] - 1e-3) ** 2])

    term = ElementTerm("wall", wall, [("x", torch.zeros(1, 1, dtype=torch.int64))])
    result = guided_projection(at(0.0), [term], settings=replace(STEPS, initial_damping=1e-3, max_iterations=12))
    refused = [record.accepted for record in result.history[1:]].index(True)
    assert 1 <= refused <= 5
    assert float(result.blocks["x"]) == pytest.approx(0.0027084, rel=1e-3)  # 2e8 (x - 0.001)^3 = 1 - x


def test_damping_rises_ever_faster_while_steps_are_refused_and_starts_anew_after_one_that_is_taken() -> None:
    refused: list[int] = []

    def guard(state: State, trial: State) -> bool:
        refused.append(len(refused))
        return len(refused) in (4, 7)

    result = guided_projection(
        at(5.0), [square()], settings=replace(STEPS, initial_damping=1.0, max_iterations=8), guard=guard
    )
    assert [record.accepted for record in result.history[1:]] == [number in (4, 7) for number in range(1, 9)]
    rises = [1.0, 2.0, 8.0, 64.0, 64.0 / 3.0, 128.0 / 3.0, 512.0 / 3.0, 512.0 / 9.0]
    assert [record.damping for record in result.history[1:]] == pytest.approx(rises)


# ---- extrapolation -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Parabola:
    """``(r + beyond)^2 / 2``, whose quadratic model has its minimum at 0 and its slope at r."""

    beyond: float

    def value(self, residuals: Tensor) -> Tensor:
        return 0.5 * (residuals[:, 0] + self.beyond).square()

    def root(self, residuals: Tensor) -> Tensor:
        return ((residuals[:, 0] + self.beyond) / residuals[:, 0]).sqrt()


def one_step(x: float, beyond: float, **changes: float) -> float:
    """Where a step without damping leads from ``x``."""
    settings = replace(STEPS, initial_damping=1e-13, max_iterations=1, **changes)
    term = replace(square(), loss=Parabola(beyond))
    return float(guided_projection(at(x), [term], settings=settings).blocks["x"])


@pytest.mark.parametrize(("x", "beyond"), [(2.0, 1.0), (1.0, 1.0), (10.0, 3.0), (0.5, 0.95), (1e-3, 1.9e-3)])
def test_where_the_merit_is_a_parabola_along_the_step_its_minimum_is_met(x: float, beyond: float) -> None:
    """The model leads to 0 with a gain of (x + 2 beyond) / (x + beyond); the parabola seen ends at -beyond."""
    assert one_step(x, beyond) == pytest.approx(-beyond, rel=1e-9)


def test_steps_become_three_times_longer_at_most() -> None:
    assert one_step(1.0, 9.0) == pytest.approx(-2.0)


def test_extrapolation_is_not_tried_where_it_is_hardly_longer_or_not_wanted() -> None:
    assert one_step(10.0, 2.4) == pytest.approx(0.0, abs=1e-9)  # 1.24 times
    assert one_step(10.0, 2.6) == pytest.approx(-2.6)
    assert one_step(10.0, 2.4, least_extrapolation=1.2) == pytest.approx(-2.4)
    assert one_step(1.0, 1.0, least_extrapolation=math.inf) == pytest.approx(0.0, abs=1e-9)


# ---- units of the damping ------------------------------------------------------------------------------------


def test_damping_is_in_units_of_the_largest_stiffness_met() -> None:
    """On x^4 / 2 the stiffness (2 x)^2 falls on the way to 0; steps are damped by that of the start all the same."""
    quartic = ElementTerm("quartic", lambda x: x[0] ** 2, [("x", torch.zeros(1, 1, dtype=torch.int64))])
    settings = replace(
        STEPS, damping_scale="diagonal", initial_damping=0.5, max_iterations=5, least_extrapolation=math.inf
    )
    x = 1.0
    for record in guided_projection(at(x), [quartic], settings=settings).history[1:]:
        assert record.accepted
        x -= 2.0 * x**3 / (4.0 * x**2 + 4.0 * record.damping)
        assert record.merit == pytest.approx(0.5 * x**4)
