"""Guided projection as printed: constant damping on the identity, every step taken, weights 1 / (|x| + epsilon)."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from torchfair.errors import SettingsError
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    LogAbsolute,
    ProjectionSettings,
    SmoothAbsolute,
    Squares,
    Status,
    guided_projection,
)

W_REG = 0.3
PRINTED = ProjectionSettings(
    step_policy="every",
    damping_scale="identity",
    initial_damping=W_REG,
    max_iterations=6,
    merit_tolerance=0.0,
    gradient_tolerance=0.0,
    when_settled="stop",
    solver="dense",
)
ONE = torch.zeros(1, 1, dtype=torch.int64)


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - 1.0


def test_steps_are_those_of_the_paper_in_dense_algebra() -> None:
    """``(J^T J + w_reg I) d = -J^T r`` over and over, with reweighted rows, nothing else."""
    vertices, topology = wavy_grid(3, 3, triangles=True)
    epsilon, weight = 0.05, 0.7
    terms = [
        ElementTerm("length", stretched, [("x", topology.edges)]),
        ElementTerm(
            "height", lambda x: x[0, 2], [("x", torch.arange(9)[:, None])], weight=weight, loss=LogAbsolute(epsilon)
        ),
    ]
    result = guided_projection({"x": vertices}, terms, settings=PRINTED)

    def rows(flat: Tensor) -> Tensor:
        points = flat.view(-1, 3)
        ends = points[topology.edges]
        return torch.cat([torch.linalg.vector_norm(ends[:, 1] - ends[:, 0], dim=1) - 1.0, points[:, 2]])

    x = vertices.flatten()
    for _ in range(PRINTED.max_iterations):
        heights = x.view(-1, 3)[:, 2].abs()
        weights = torch.cat([x.new_ones(topology.num_edges), weight / (heights + epsilon)])
        jacobian, values = torch.func.jacrev(rows)(x), rows(x)
        normal = jacobian.T @ (weights[:, None] * jacobian) + W_REG * torch.eye(x.numel(), dtype=DOUBLE)
        x = x - torch.linalg.solve(normal, jacobian.T @ (weights * values))
    torch.testing.assert_close(result.blocks["x"].flatten(), x, rtol=1e-9, atol=1e-11)
    assert [record.damping for record in result.history[1:]] == [W_REG] * PRINTED.max_iterations
    assert all(record.accepted for record in result.history)


def test_a_step_is_taken_although_the_merit_rises() -> None:
    """Newton's method for atan from 2 goes farther and farther away."""
    term = ElementTerm("atan", lambda x: torch.atan(x[0]), [("x", ONE)])
    start = {"x": torch.full((1, 1), 2.0, dtype=DOUBLE)}
    bold = replace(PRINTED, initial_damping=1e-12, max_iterations=2)
    result = guided_projection(start, [term], settings=bold)
    x, places = 2.0, []
    for _ in range(2):
        x -= math.atan(x) * (1.0 + x * x)
        places.append(x)
    assert float(result.blocks["x"]) == pytest.approx(places[-1], rel=1e-5)
    merits = [record.merit for record in result.history]
    assert merits == sorted(merits)
    assert merits[0] < merits[-1]
    assert "raised the merit by" in result.message
    judged = guided_projection(start, [term], settings=replace(bold, step_policy="judged", max_iterations=50))
    assert abs(float(judged.blocks["x"])) < 1e-6


def test_neither_guards_nor_corrections_nor_longer_steps() -> None:
    def never(state: object, trial: object) -> bool:
        raise AssertionError("a guard was asked")

    calls: list[int] = []

    def counted(x: Tensor) -> Tensor:
        calls.append(len(x))
        return (x[:, 0, 0] ** 2 - 1.0)[:, None]

    term = ElementTerm("square", counted, [("x", ONE)], batched=True, loss=SmoothAbsolute(1e-3))
    problem = GuidedProjection({"x": torch.full((1, 1), 3.0, dtype=DOUBLE)}, [term], solver="dense")
    settings = replace(PRINTED, max_iterations=3)
    start = {"x": torch.full((1, 1), 3.0, dtype=DOUBLE)}
    problem.solve(start, settings=replace(settings, max_iterations=0))
    before = len(calls)
    problem.solve(start, settings=replace(settings, max_iterations=0))
    idle = len(calls) - before
    before = len(calls)
    problem.solve(start, settings=settings, guard=never)
    # each step evaluates the residual where it leads, and differentiates there
    assert len(calls) - before == idle + 2 * 3


def test_a_step_to_what_is_not_finite_ends_the_run_before_it() -> None:
    term = ElementTerm("root", lambda x: x[0].sqrt(), [("x", ONE)])
    start = {"x": torch.full((1, 1), 1.0, dtype=DOUBLE)}
    result = guided_projection(start, [term], settings=replace(PRINTED, initial_damping=1e-9))
    assert result.status is Status.DIVERGED
    assert not result.status.converged
    assert "raise initial_damping" in result.message
    assert torch.equal(result.blocks["x"], start["x"])
    assert [record.accepted for record in result.history] == [True, False]


def test_a_run_comes_to_rest_when_the_merit_neither_falls_nor_rises() -> None:
    """A step that raises the merit much is no rest."""
    term = ElementTerm("atan", lambda x: torch.atan(x[0]), [("x", ONE)])
    start = {"x": torch.full((1, 1), 2.0, dtype=DOUBLE)}
    settings = replace(PRINTED, initial_damping=1e-12, merit_tolerance=1e-2, patience=1)
    assert guided_projection(start, [term], settings=settings).iterations > 2
    square = ElementTerm("square", lambda x: torch.cat([x[0] - 1.0, x[0] + 1.0]), [("x", ONE)])
    calm = guided_projection(start, [square], settings=replace(settings, initial_damping=1.0, max_iterations=50))
    assert calm.status is Status.SETTLED
    judged = replace(settings, initial_damping=1.0, max_iterations=50, when_settled="judge", merit_tolerance=1e-6)
    assert guided_projection(start, [square], settings=judged).status is Status.MERIT_TOLERANCE


def test_members_of_a_batch_take_every_step_each() -> None:
    """One diverges at once, the others go on as they would alone."""
    term = ElementTerm("root", lambda x: (x[0] + 1.0).sqrt() - 1.2, [("x", ONE)])
    starts = torch.tensor([1.0, 60.0, 0.5], dtype=DOUBLE).view(3, 1, 1)
    settings = replace(PRINTED, initial_damping=1e-6)
    problem = GuidedProjection({"x": starts[0]}, [term], solver="dense")
    together = problem.solve_batch({"x": starts}, settings=settings)
    alone = [problem.solve({"x": start}, settings=settings) for start in starts]
    assert [result.status for result in together] == [result.status for result in alone]
    assert together[1].status is Status.DIVERGED
    for mine, other in zip(together, alone, strict=True):
        torch.testing.assert_close(mine.blocks["x"], other.blocks["x"])
        assert [r.merit for r in mine.history] == pytest.approx([r.merit for r in other.history])


def test_policy_is_one_of_two_words() -> None:
    with pytest.raises(SettingsError, match="step_policy must be 'judged' or 'every', got 'some'"):
        ProjectionSettings(step_policy="some")  # type: ignore[arg-type]


# ---- the absolute value ------------------------------------------------------------------------------------

SIZES = st.floats(-1e6, 1e6)


@given(SIZES, SIZES, st.floats(1e-6, 1e3))
def test_the_printed_weights_are_a_model_above_the_loss_that_touches_it(here: float, there: float, eps: float) -> None:
    loss = LogAbsolute(eps)
    r, s = (torch.tensor([[x]], dtype=DOUBLE) for x in (here, there))
    weight = float(loss.root(r)) ** 2
    assert weight == pytest.approx(1.0 / (abs(here) + eps))
    model = float(loss.value(r)) + 0.5 * weight * (there**2 - here**2)
    assert float(loss.value(s)) <= model + 1e-9 * (1.0 + abs(model) + weight * here**2)


def test_the_gradient_of_the_loss_is_that_of_the_printed_model() -> None:
    r = torch.tensor([[3.0, -4.0], [1e-3, 0.0], [-20.0, 7.0]], dtype=DOUBLE, requires_grad=True)
    loss = LogAbsolute(0.1)
    (found,) = torch.autograd.grad(loss.value(r).sum(), r)
    torch.testing.assert_close(found, loss.root(r.detach())[:, None] ** 2 * r.detach())


def test_the_loss_tends_to_the_absolute_value_and_to_half_a_square_over_epsilon() -> None:
    r = torch.tensor([[2.0]], dtype=DOUBLE)
    for eps in (1e-2, 1e-4, 1e-6):
        assert float(LogAbsolute(eps).value(r)) == pytest.approx(2.0 - eps * math.log(1.0 + 2.0 / eps), rel=1e-12)
    assert float(LogAbsolute(1e5).value(r)) == pytest.approx(float(Squares().value(r)) / 1e5, rel=1e-4)
    zero = torch.zeros(1, 3, dtype=DOUBLE, requires_grad=True)
    (slope,) = torch.autograd.grad(LogAbsolute(1e-3).value(zero).sum(), zero)
    assert not slope.any()


@pytest.mark.parametrize("epsilon", [0.0, -1.0, math.inf, math.nan])
def test_epsilon_is_above_zero(epsilon: float) -> None:
    with pytest.raises(SettingsError, match="epsilon of LogAbsolute"):
        LogAbsolute(epsilon)
