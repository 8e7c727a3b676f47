"""Steps solved by iteration only as well as needed: same end as with exact steps."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair.linear.base import Pattern, Solution, System
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, Status, guided_projection, init
from torchfair.projection.proposal import Proposal


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
    asked: list[float] = []  # after each step, of the next one
    settings = ProjectionSettings(solver="cg", merit_tolerance=tolerance, accuracy=0.3, initial_damping=10.0)
    result = guided_projection(
        blocks, terms, settings=settings, callback=lambda record: asked.append(record.state.accuracy)
    )
    assert result.status is Status.MERIT_TOLERANCE
    assert asked == sorted(asked, reverse=True)
    assert asked[0] == 0.3
    assert asked[-1] == pytest.approx(0.1 * math.sqrt(tolerance))
    merits = [record.merit for record in result.history]
    for step in range(1, len(asked)):
        if asked[step] < asked[step - 1]:
            assert merits[step - 1] - merits[step] < tolerance * merits[step - 1]


class Partly:
    """A solver that goes only part of the way; what is left is not orthogonal to its solutions."""

    name, inexact = "partly", True

    def __init__(self, share: float) -> None:
        self.share = share

    def prepare(self, pattern: Pattern) -> None:
        """Nothing to prepare."""

    def factorise(self, system: System, damping: Tensor) -> Partly:
        """A dense matrix."""
        self.matrix = system.product(torch.eye(damping.shape[0], dtype=damping.dtype)) + torch.diag(damping)
        return self

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        """A share of the solution."""
        return Solution(self.share * torch.linalg.solve(self.matrix, right), (1.0 - self.share) * right)


@pytest.mark.parametrize("solver", [Partly(1.0), Partly(0.7), Partly(1.4), "cg"])
def test_rough_steps_promise_what_the_model_falls_by(solver: Partly | str) -> None:
    """Also what the remainder of the linear solution makes of it, against the changes of all residuals."""
    blocks, terms = strained_net()
    problem = GuidedProjection(blocks, terms, solver=solver)
    system = problem.structure.linearise(blocks)
    proposal = Proposal.of(system, problem.solver, 0.1 * system.diagonal, 0.3)
    after = system.residual_vector + system.jacobian @ proposal.change
    fall = 0.5 * float(system.residual_vector.square().sum() - after.square().sum())
    assert float(proposal.predicted) == pytest.approx(fall, rel=1e-9)
    assert float(system.predicted_fall(proposal.change)) == pytest.approx(fall, rel=1e-9)


def test_a_batch_is_solved_as_accurately_as_the_member_that_asks_for_most() -> None:
    blocks, terms = strained_net()
    state = init(GuidedProjection(blocks, terms, solver="cg"), blocks)
    (course,) = state.courses
    courses = tuple(replace(course, accuracy=accuracy) for accuracy in (1e-1, 1e-4, 1e-2))
    assert replace(state, courses=courses).accuracy == 1e-4
