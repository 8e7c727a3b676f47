"""Steps that are corrected for the curvature of residuals, with the factor that is there."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.projection import ElementTerm, GuidedProjection, OneSided, ProjectionSettings, SmoothAbsolute, init
from torchfair.projection.proposal import Proposal

PLAIN = ProjectionSettings(least_uncorrected_gain=-math.inf)


def on_circle(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[0]) - 1.0


def towards(x: Tensor, place: Tensor) -> Tensor:
    return x[0] - place


def slide(weight: float = 1e6) -> GuidedProjection:
    """A point slides along a stiff circle to the place nearest to (0, -1): a quarter of the way around."""
    row = torch.zeros(1, 1, dtype=torch.int64)
    place = torch.tensor([[0.0, -1.0]], dtype=DOUBLE)
    terms = [
        ElementTerm("circle", on_circle, [("x", row)], weight=weight),
        ElementTerm("towards", towards, [("x", row)], data=(place,)),
    ]
    return GuidedProjection({"x": place}, terms)


def test_stiff_curved_constraints_need_fewer_steps() -> None:
    start = {"x": torch.tensor([[1.0, 0.0]], dtype=DOUBLE)}
    corrected, plain = (slide().solve(start, settings=settings) for settings in (ProjectionSettings(), PLAIN))
    assert corrected.status.converged
    assert corrected.blocks["x"][0].tolist() == pytest.approx([0.0, -1.0], abs=1e-6)
    assert corrected.iterations < 0.6 * plain.iterations
    assert plain.history[corrected.iterations].merit - corrected.merit > 0.1


def test_the_correction_solves_the_damped_problem_with_the_residuals_of_the_trial() -> None:
    """Against dense algebra; weights are those of the start, inequalities those that the step heeds."""
    vertices, topology = wavy_grid(5, 4, triangles=True)
    every = torch.arange(20)[:, None]
    terms = [
        ElementTerm("length", lambda x: (x[1] - x[0]).norm() - 0.9, [("x", topology.edges)], weight=2.0),
        ElementTerm("flat", lambda x: x[0, 2] ** 2, [("x", every)], loss=SmoothAbsolute(0.1)),
        ElementTerm("ceiling", lambda x: x[0, 2] - 0.05, [("x", every)], loss=OneSided()),
        ElementTerm("held", towards, [("x", every)], data=(1.1 * vertices,), linear=True),
    ]
    fixed = {"x": torch.arange(20) < 3}
    problem = GuidedProjection({"x": vertices}, terms, fixed=fixed, solver="scipy")
    state = init(problem, {"x": vertices})
    problem.prepare()
    damping = torch.linspace(0.1, 1.0, 60, dtype=DOUBLE)
    system = state.linearised.system
    proposal = Proposal.of(system, problem.solver, damping, 1e-12)
    flat = problem.layout.flatten(state.blocks)
    trial = problem.structure.evaluate(problem.layout.unflatten(flat + proposal.change))
    jacobian = system.jacobian.to_dense()
    rows = []
    for compiled, values in zip(problem.structure.compiled, trial.values, strict=True):
        at_start = compiled.term.values(compiled.term.arguments(state.blocks))
        rows.append((values * compiled.term.roots(at_start)[:, None]).T.reshape(-1))
    right = jacobian.T @ torch.cat([*rows, trial.affine]) + damping * proposal.change
    expected = -torch.linalg.solve(jacobian.T @ jacobian + torch.diag(damping), right)
    found = proposal.correction(trial, proposal.change, 1e-12)
    torch.testing.assert_close(found, expected * problem.structure.free, atol=1e-10, rtol=0)
    assert float(found.abs().max()) > 1e-3


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e5])
def test_corrections_do_not_depend_on_units(size: float) -> None:
    row = torch.zeros(1, 1, dtype=torch.int64)
    terms = [
        ElementTerm("circle", lambda x: (torch.linalg.vector_norm(x[0]) / size - 1.0) * size, [("x", row)], weight=1e6),
        ElementTerm("towards", towards, [("x", row)], data=(torch.tensor([[0.0, -size]], dtype=DOUBLE),)),
    ]
    start = {"x": torch.tensor([[size, 0.0]], dtype=DOUBLE)}
    result = GuidedProjection(start, terms).solve(start)
    known = slide().solve({"x": start["x"] / size})
    assert result.iterations == known.iterations
    torch.testing.assert_close(result.blocks["x"] / size, known.blocks["x"], atol=1e-9, rtol=0)


def test_a_correction_longer_than_the_step_is_not_trusted() -> None:
    """exp(x) rises so steeply that the residual at the trial says nothing about the way there."""
    row = torch.zeros(1, 1, dtype=torch.int64)
    term = ElementTerm("exp", lambda x: torch.exp(x[0]) - 1.0, [("x", row)])
    start = {"x": torch.full((1, 1), -6.0, dtype=DOUBLE)}
    few = ProjectionSettings(max_iterations=1, initial_damping=1e-6)
    corrected, plain = (
        GuidedProjection(start, [term]).solve(start, settings=replace(few, least_uncorrected_gain=gain))
        for gain in (0.9, -math.inf)
    )
    assert not plain.history[1].accepted
    assert not corrected.history[1].accepted


@pytest.mark.parametrize(("bend", "end"), [(-0.7, -0.3), (-0.74, -0.26), (-0.76, -1.0), (0.5, -1.0)])
def test_a_correction_is_taken_if_it_is_moderate_and_better(bend: float, end: float) -> None:
    """The step of 1 + x + bend x^2 from 0 leads to -1, where the residual is bend: the correction is -bend.

    Above three quarters of the step it is not tried; with 0.5 it lowers the merit, but less than the step alone.
    """
    term = ElementTerm("bent", lambda x: 1.0 + x[0] + bend * x[0] ** 2, [("x", torch.zeros(1, 1, dtype=torch.int64))])
    start = {"x": torch.zeros(1, 1, dtype=DOUBLE)}
    settings = ProjectionSettings(max_iterations=1, initial_damping=1e-13)
    result = GuidedProjection(start, [term]).solve(start, settings=settings)
    assert float(result.blocks["x"]) == pytest.approx(end, abs=1e-9)
