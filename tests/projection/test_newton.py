"""Descent with exact second derivatives."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, GuidedProjection
from torchfair.projection.merit_derivatives import MeritDerivatives
from torchfair.projection.newton import descended

NODE = torch.tensor([[0]])


def problem(*terms: ElementTerm) -> GuidedProjection:
    return GuidedProjection({"x": torch.zeros(1, 2, dtype=DOUBLE)}, terms)


def at(*place: float) -> dict[str, Tensor]:
    return {"x": torch.tensor([place], dtype=DOUBLE)}


def valley() -> ElementTerm:
    """Rosenbrock's: least at (1, 1)."""
    return ElementTerm("valley", lambda x: torch.stack([10.0 * (x[0, 1] - x[0, 0] ** 2), 1.0 - x[0, 0]]), [("x", NODE)])


def well() -> ElementTerm:
    """Least at x = -1 and 1, with a saddle between; the residual does not vanish there."""
    return ElementTerm("well", lambda x: torch.stack([x[0, 0] ** 2 - 1.0, x[0, 1]]), [("x", NODE)])


def test_a_curved_valley_is_followed_to_its_end() -> None:
    found = descended(problem(valley()), at(-1.2, 1.0), tolerance=1e-10)
    assert found.arrived
    torch.testing.assert_close(found.blocks["x"], torch.ones(1, 2, dtype=DOUBLE), rtol=0.0, atol=1e-8)


def test_saddles_are_left() -> None:
    """Close to the top, with curvature down and next to no slope."""
    found = descended(problem(well()), at(1e-6, 0.3))
    assert found.arrived
    torch.testing.assert_close(found.blocks["x"], torch.tensor([[1.0, 0.0]], dtype=DOUBLE), rtol=0.0, atol=1e-6)


def test_the_merit_falls_and_the_guard_is_asked() -> None:
    """A guard that lets x grow to 0.9 only: no state beyond it, and the descent says who refused."""
    seen: list[float] = []

    def guard(state: dict[str, Tensor], trial: dict[str, Tensor]) -> bool:
        seen.append(float(trial["x"][0, 0]))
        return seen[-1] < 0.9

    found = descended(problem(well()), at(0.5, 0.3), guard=guard, most=60)
    assert float(found.blocks["x"][0, 0]) < 0.9
    assert max(seen) >= 0.9
    assert not found.arrived
    assert found.refused


def test_at_a_minimum_no_step_is_taken() -> None:
    found = descended(problem(valley()), at(1.0, 1.0))
    assert (found.steps, found.arrived) == (0, True)
    torch.testing.assert_close(found.blocks["x"], torch.ones(1, 2, dtype=DOUBLE), rtol=0.0, atol=0.0)


def test_few_steps_are_few() -> None:
    found = descended(problem(valley()), at(-1.2, 1.0), most=2)
    assert (found.steps, found.arrived) == (2, False)


@pytest.mark.parametrize("slope", [0.3, 3.0])
def test_steps_are_those_of_newton_near_the_end(slope: float) -> None:
    """Quadratic convergence: exact second derivatives, where those of Gauss and Newton converge linearly."""
    bowl = ElementTerm(
        "bowl", lambda x: torch.stack([x[0].square().sum() + 1.0, slope * (x[0, 0] - 0.2)]), [("x", NODE)]
    )
    found = descended(problem(bowl), at(0.3, 0.2), tolerance=1e-12)
    assert found.arrived
    assert found.steps <= 7
    merit = MeritDerivatives(problem(bowl).layout, [bowl], found.blocks, torch.ones(2, dtype=torch.bool))
    # A fall of the merit below rounding cannot be told: that is where the square of the distance is.
    assert float(merit.gradient.detach().norm()) < 5e-8
