"""Inequalities: steps heed also those that hold now, and find the minimum of the convex model they belong to."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from torchfair import ShapeError
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    OneSided,
    ProjectionSettings,
    Squares,
    Status,
    guided_projection,
    init,
)
from torchfair.projection.loss import Loss

FREE_STEPS = ProjectionSettings(initial_damping=1e-12, damping_scale="identity", solver="dense")


def place(x: Tensor, target: Tensor) -> Tensor:
    return x[0] - target


def spring(x: Tensor) -> Tensor:
    return x[1] - x[0]


def beyond(x: Tensor, normal: Tensor, offset: Tensor) -> Tensor:
    return torch.dot(normal, x[0]) - offset


def broken(x: Tensor, normal: Tensor, offset: Tensor) -> Tensor:
    return torch.relu(beyond(x, normal, offset))


def corner_problem(
    normals: Tensor, offsets: Tensor, target: Tensor, weight: float = 1.0, *, loss: Loss | None = None
) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """One point drawn to a target, with half-spaces ``normal . x <= offset`` that it is to stay in."""
    rows = torch.zeros(normals.shape[0], 1, dtype=torch.int64)
    residual = beyond if loss is None else broken
    terms = [
        ElementTerm("target", place, [("x", rows[:1])], data=(target[None],), linear=True),
        ElementTerm("walls", residual, [("x", rows)], data=(normals, offsets), weight=weight, loss=loss or OneSided()),
    ]
    return {"x": torch.zeros(1, target.shape[0], dtype=DOUBLE)}, terms


def merit(x: Tensor, normals: Tensor, offsets: Tensor, target: Tensor, weight: float) -> Tensor:
    walls = torch.relu(normals @ x - offsets)
    return 0.5 * (x - target).square().sum() + 0.5 * weight * walls.square().sum()


def lowest_by_enumeration(normals: Tensor, offsets: Tensor, target: Tensor, weight: float) -> float:
    """Least merit over the minima for every choice of walls that are felt; one of them is the minimum."""
    least = float("inf")
    count = normals.shape[0]
    for choice in range(2**count):
        felt = torch.tensor([bool(choice >> i & 1) for i in range(count)])
        a, b = normals[felt], offsets[felt]
        matrix = torch.eye(target.shape[0], dtype=DOUBLE) + weight * a.T @ a
        x = torch.linalg.solve(matrix, target + weight * a.T @ b)
        least = min(least, float(merit(x, normals, offsets, target, weight)))
    return least


def test_loss_counts_what_is_above_zero() -> None:
    values = torch.tensor([[-3.0, 2.0, 1.0], [-1.0, -2.0, 0.0]], dtype=DOUBLE, requires_grad=True)
    loss = OneSided().value(values)
    assert loss.tolist() == [2.5, 0.0]
    (gradient,) = torch.autograd.grad(loss.sum(), values)
    assert gradient.tolist() == [[0.0, 2.0, 1.0], [0.0, 0.0, 0.0]]


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 7), weight=st.sampled_from([0.1, 1.0, 100.0]))
def test_steps_reach_the_minimum_of_a_convex_problem(seed: int, count: int, weight: float) -> None:
    """With linear residuals the model is the merit itself: a few steps find its minimum, however walls meet."""
    generator = torch.Generator().manual_seed(seed)
    normals = torch.randn(count, 3, dtype=DOUBLE, generator=generator)
    offsets = torch.rand(count, dtype=DOUBLE, generator=generator)
    target = 3.0 * torch.randn(3, dtype=DOUBLE, generator=generator)
    blocks, terms = corner_problem(normals, offsets, target, weight)
    result = guided_projection(blocks, terms, settings=replace(FREE_STEPS, max_iterations=8))
    expected = lowest_by_enumeration(normals, offsets, target, weight)
    assert result.merit == pytest.approx(expected, rel=1e-8, abs=1e-12)
    assert all(record.accepted for record in result.history if record.step > 1e-6)


def test_a_step_stops_at_a_wall_that_held_before_it() -> None:
    """The wall is not felt at the start; without looking ahead the first steps break it and are refused."""
    normals = torch.tensor([[1.0, 0.0], [0.0, 1.0]], dtype=DOUBLE)
    offsets = torch.tensor([0.1, 5.0], dtype=DOUBLE)
    target = torch.tensor([2.0, 1.0], dtype=DOUBLE)
    ahead = guided_projection(
        *corner_problem(normals, offsets, target, 1e4), settings=replace(FREE_STEPS, max_iterations=1)
    )
    assert ahead.history[-1].accepted
    assert ahead.history[-1].gain == pytest.approx(1.0, abs=1e-6)
    assert ahead.blocks["x"][0].tolist() == pytest.approx([0.1, 1.0], abs=1e-3)
    blind = guided_projection(
        *corner_problem(normals, offsets, target, 1e4, loss=Squares()), settings=replace(FREE_STEPS, max_iterations=1)
    )
    assert not blind.history[-1].accepted


def test_a_wall_that_is_left_is_not_felt_any_more() -> None:
    normals = torch.tensor([[1.0, 0.0]], dtype=DOUBLE)
    offsets = torch.tensor([-1.0], dtype=DOUBLE)
    target = torch.tensor([-3.0, 1.0], dtype=DOUBLE)
    result = guided_projection(*corner_problem(normals, offsets, target), settings=FREE_STEPS)
    assert result.blocks["x"][0].tolist() == pytest.approx([-3.0, 1.0], abs=1e-9)
    assert result.merit == pytest.approx(0.0, abs=1e-15)


def test_the_report_shows_only_what_is_broken() -> None:
    normals = torch.tensor([[1.0, 0.0], [0.0, 1.0]], dtype=DOUBLE)
    offsets = torch.tensor([-2.0, 7.0], dtype=DOUBLE)
    target = torch.zeros(2, dtype=DOUBLE)
    result = guided_projection(
        *corner_problem(normals, offsets, target), settings=replace(FREE_STEPS, max_iterations=0)
    )
    row = next(row for row in result.initial_residuals if row.name == "walls")
    assert (row.mean, row.largest, row.merit) == (1.0, 2.0, 2.0)


def net_in_a_ball(loss: Loss) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """A net of springs, some of its vertices drawn far out of the ball around the middle that all are to stay in."""
    vertices, topology = wavy_grid(triangles=True)
    middle = vertices.mean(0)
    radius = 1.05 * float(torch.linalg.vector_norm(vertices - middle, dim=1).max())

    def outside(x: Tensor) -> Tensor:
        excess = torch.linalg.vector_norm(x[0] - middle) - radius
        return excess if isinstance(loss, OneSided) else torch.relu(excess)

    rows = torch.arange(topology.num_vertices)[:, None]
    pulled = torch.tensor([[0], [5], [14], [29]])
    places = middle + 3.0 * (vertices[pulled[:, 0]] - middle) + torch.tensor([0.0, 0.0, 2.0], dtype=DOUBLE)
    terms = [
        ElementTerm("ball", outside, [("x", rows)], weight=1e2, loss=loss),
        ElementTerm("springs", spring, [("x", topology.edges)], weight=0.1, linear=True),
        ElementTerm("pull", place, [("x", pulled)], data=(places,), linear=True),
    ]
    return {"x": vertices}, terms


@pytest.mark.parametrize("solver", ["dense", "scipy", "cg", "auto"])
def test_all_linear_solvers_find_the_minimum_that_blind_steps_find(solver: str) -> None:
    choice = ProjectionSettings(solver=solver, max_iterations=100, accuracy=1e-10, merit_tolerance=1e-14)
    fixed = {"x": torch.zeros(30, 3, dtype=torch.bool)}
    fixed["x"][10:12] = True
    blocks, terms = net_in_a_ball(OneSided())
    result = guided_projection(blocks, terms, fixed=fixed, settings=choice)
    blind = guided_projection(*net_in_a_ball(Squares()), fixed=fixed, settings=replace(choice, max_iterations=400))
    assert torch.equal(result.blocks["x"][10:12], blocks["x"][10:12])
    assert result.merit == pytest.approx(blind.merit, rel=1e-7)
    assert sum(not record.accepted for record in result.history) <= sum(not r.accepted for r in blind.history)


def test_gradient_is_that_of_the_merit() -> None:
    """At a minimum that some inequalities hold exactly and others do not, the gradient of the merit vanishes."""
    blocks, terms = net_in_a_ball(OneSided())
    choice = ProjectionSettings(max_iterations=100, merit_tolerance=1e-16)
    result = guided_projection(blocks, terms, settings=choice)
    assert result.status is not Status.MAX_ITERATIONS
    assert 0 < int((terms[0].values(terms[0].arguments(result.blocks)) > 0.0).sum()) < 30
    x = result.blocks["x"].requires_grad_()
    total = sum(
        term.contributions(arguments, term.values(arguments)).sum()
        for term in terms
        for arguments in [term.arguments({"x": x})]
    )
    (gradient,) = torch.autograd.grad(total, x)
    assert float(gradient.abs().max()) < 1e-6


def test_inequalities_have_no_merit_of_their_own() -> None:
    rows = torch.zeros(1, 1, dtype=torch.int64)
    data = (torch.ones(1, 3, dtype=DOUBLE), torch.ones(1, dtype=DOUBLE))
    term = ElementTerm("walls", beyond, [("x", rows)], data=data, loss=OneSided(), merit=broken)
    with pytest.raises(ShapeError, match="walls"):
        guided_projection({"x": torch.zeros(1, 3, dtype=DOUBLE)}, [term])


def test_walls_of_several_terms_are_as_good_as_walls_of_one() -> None:
    """Terms of two, one, three and one wall, so that no other place in the list would do."""
    generator = torch.Generator().manual_seed(5)
    normals = torch.randn(7, 3, dtype=DOUBLE, generator=generator)
    offsets = torch.rand(7, dtype=DOUBLE, generator=generator)
    target = 3.0 * torch.randn(3, dtype=DOUBLE, generator=generator)
    blocks, (pull, walls) = corner_problem(normals, offsets, target, 10.0)
    parts = [torch.tensor(rows) for rows in ([0, 1], [2], [3, 4, 5], [6])]
    rows = [("x", torch.zeros(7, 1, dtype=torch.int64))]
    several = [replace(walls, stencil=[("x", rows[0][1][part])], data=(normals[part], offsets[part])) for part in parts]
    whole, split = (
        guided_projection(blocks, terms, settings=FREE_STEPS) for terms in ([pull, walls], [pull, *several])
    )
    assert [record.inner_iterations for record in split.history] == [r.inner_iterations for r in whole.history]
    torch.testing.assert_close(split.blocks["x"], whole.blocks["x"], atol=1e-12, rtol=0)
    assert split.merit == pytest.approx(lowest_by_enumeration(normals, offsets, target, 10.0), rel=1e-8)


def test_to_know_what_the_step_before_heeded_saves_linear_solves() -> None:
    """A wall that holds before the step and is met by it: heeded from the start, the first solution is the step."""
    normals = torch.tensor([[1.0, 0.0], [0.0, 1.0]], dtype=DOUBLE)
    blocks, terms = corner_problem(normals, torch.tensor([0.1, 5.0], dtype=DOUBLE), torch.ones(2, dtype=DOUBLE), 100.0)
    problem = GuidedProjection(blocks, terms, solver="dense")
    inequalities = init(problem, blocks).linearised.inequalities
    assert inequalities is not None
    damping = torch.full((2,), 0.1, dtype=DOUBLE)
    first = inequalities.propose(problem.solver, damping, None, 1e-12)
    again = inequalities.propose(problem.solver, damping, first.heeded, 1e-12)
    assert first.heeded.tolist() == [True, False]
    assert first.iterations > again.iterations == 1
    torch.testing.assert_close(again.change, first.change, atol=1e-12, rtol=0)
