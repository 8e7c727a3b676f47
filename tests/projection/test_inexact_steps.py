"""Steps solved by iteration only as well as needed: same end as with exact steps."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair.linear import ConjugateGradients, Factor, Solution, System
from torchfair.projection import ElementTerm, ProjectionSettings, Status, guided_projection


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - 1.0


def anchor(x: Tensor, place: Tensor) -> Tensor:
    return x[0] - place


def strained_net() -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """Edges that should have unit length, between vertices that are held elsewhere: a minimum above zero."""
    vertices, topology = wavy_grid(8, 8, triangles=True)
    every = torch.arange(64)[:, None]
    terms = [
        ElementTerm("length", stretched, [("x", topology.edges)]),
        ElementTerm("held", anchor, [("x", every)], data=(1.2 * vertices,), linear=True),
    ]
    return {"x": vertices}, terms


class Listening(ConjugateGradients):
    """Notes the accuracy asked for in each step."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[float] = []

    def factorise(self, system: System, damping: Tensor) -> ListeningFactor:
        return ListeningFactor(super().factorise(system, damping), self.asked)


class ListeningFactor:
    def __init__(self, factor: Factor, asked: list[float]) -> None:
        self.factor, self.asked = factor, asked

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        self.asked.append(accuracy)
        return self.factor.solve(right, accuracy)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_inexact_steps_reach_the_merit_of_exact_ones(tolerance: float) -> None:
    blocks, terms = strained_net()
    exact = guided_projection(blocks, terms, settings=ProjectionSettings(solver="scipy", merit_tolerance=1e-14))
    settings = ProjectionSettings(solver="cg", merit_tolerance=tolerance, accuracy=0.3, max_iterations=300)
    inexact = guided_projection(blocks, terms, settings=settings)
    assert inexact.status.converged
    assert exact.merit > 0.1
    assert inexact.merit == pytest.approx(exact.merit, rel=10 * tolerance)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_accuracy_is_tightened_only_when_the_merit_rests(tolerance: float) -> None:
    blocks, terms = strained_net()
    solver = Listening()
    settings = ProjectionSettings(solver=solver, merit_tolerance=tolerance, accuracy=0.3, initial_damping=10.0)
    result = guided_projection(blocks, terms, settings=settings)
    assert result.status is Status.MERIT_TOLERANCE
    assert solver.asked == sorted(solver.asked, reverse=True)
    assert solver.asked[0] == 0.3
    assert solver.asked[-1] == pytest.approx(0.1 * math.sqrt(tolerance))
    merits = [record.merit for record in result.history]
    for step in range(1, len(solver.asked)):
        if solver.asked[step] < solver.asked[step - 1]:
            assert merits[step - 1] - merits[step] < tolerance * merits[step - 1]
