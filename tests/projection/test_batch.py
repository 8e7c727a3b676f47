"""A batch solved as one system: every member as if it were alone."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.constraints import closeness_terms, interior_fairness_terms, normal_variation_terms
from torchfair.constraints.closeness import TangentPlanes
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    OneSided,
    ProjectionResult,
    ProjectionSettings,
    Status,
    steps,
)


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - 1.0


def held(x: Tensor, place: Tensor) -> Tensor:
    return x[0] - place


def below(x: Tensor) -> Tensor:
    return x[0, 2] - 0.05


def net_terms(vertices: Tensor, topology: Topology) -> list[ElementTerm]:
    """Lengths, places and a ceiling: linear, one-sided and weighted terms, well-conditioned."""
    every = torch.arange(vertices.shape[0])[:, None]
    weights = torch.linspace(0.5, 2.0, vertices.shape[0], dtype=DOUBLE)
    return [
        ElementTerm("length", stretched, [("x", topology.edges)]),
        ElementTerm("held", held, [("x", every)], data=(1.2 * vertices,), linear=True),
        ElementTerm("weighted", held, [("x", every)], data=(vertices,), element_weights=weights),
        ElementTerm("ceiling", below, [("x", every)], weight=30.0, loss=OneSided()),
    ]


def net() -> tuple[GuidedProjection, Tensor]:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    noise = torch.randn(7, 30, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    sizes = torch.tensor([0.0, 0.01, 0.1, 0.2, 0.3, 0.5, 0.8], dtype=DOUBLE)
    fixed = {"x": torch.arange(30) < 3}
    problem = GuidedProjection({"x": vertices}, net_terms(vertices, topology), fixed=fixed, solver="scipy")
    return problem, vertices + sizes[:, None, None] * noise


def assert_same(together: list[ProjectionResult], alone: list[ProjectionResult]) -> None:
    for mine, other in zip(together, alone, strict=True):
        assert mine.status is other.status
        assert mine.iterations == other.iterations
        torch.testing.assert_close(mine.blocks["x"], other.blocks["x"], atol=1e-9, rtol=0)
        rows, known = mine.residuals + mine.initial_residuals, other.residuals + other.initial_residuals
        for row, twin in zip(rows, known, strict=True):
            assert (row.name, row.elements, row.weight) == (twin.name, twin.elements, twin.weight)
            numbers = (twin.mean, twin.largest, twin.merit)
            assert (row.mean, row.largest, row.merit) == pytest.approx(numbers, abs=1e-8)
        for step, mate in zip(mine.history, other.history, strict=True):
            assert (step.accepted, step.iteration) == (mate.accepted, mate.iteration)
            assert step.merit == pytest.approx(mate.merit, rel=1e-9)
            assert step.damping == pytest.approx(
                mate.damping, rel=1e-2, nan_ok=True
            )  # of vanishing differences at the end


def test_members_end_as_they_do_alone() -> None:
    """They need different numbers of steps, so that some leave while others go on."""
    problem, starts = net()
    settings = ProjectionSettings(max_iterations=40)
    alone = [problem.solve({"x": start}, settings=settings) for start in starts]
    assert len({result.iterations for result in alone}) > 2
    assert_same(problem.solve_batch({"x": starts}, settings=settings), alone)


def test_members_stop_at_limits_as_they_do_alone() -> None:
    problem, starts = net()
    settings = ProjectionSettings(max_iterations=3)
    together = problem.solve_batch({"x": starts}, settings=settings)
    assert_same(together, [problem.solve({"x": start}, settings=settings) for start in starts])
    assert Status.MAX_ITERATIONS in {result.status for result in together}


def test_data_are_refreshed_for_each_member() -> None:
    """Closest points on one surface from the vertices of every member, and E."""
    vertices, topology = wavy_grid(6, 5, triangles=True)
    planes = TangentPlanes(ReferenceSurface(vertices, topology), block="x")
    terms = [
        *normal_variation_terms(topology, smoothing=0.1, block="x"),
        *interior_fairness_terms(topology, weight=0.1, block="x"),
        *closeness_terms(planes, torch.arange(30), weight=10.0, block="x"),
        ElementTerm("held", held, [("x", torch.arange(30)[:, None])], data=(vertices,), linear=True),
    ]
    noise = 0.1 * torch.randn(4, 30, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    problem = GuidedProjection({"x": vertices}, terms, solver="scipy")
    settings = ProjectionSettings(max_iterations=6)
    alone = [problem.solve({"x": start}, settings=settings) for start in vertices + noise]
    assert_same(problem.solve_batch({"x": vertices + noise}, settings=settings), alone)


def test_blocks_of_several_sizes() -> None:
    """Nodes of width three and one; a member is rows of each."""
    vertices, topology = wavy_grid(4, 4)
    edges = topology.edges

    def slack(x: Tensor, s: Tensor) -> Tensor:
        return torch.linalg.vector_norm(x[1] - x[0]) - s[0, 0] ** 2

    def small(s: Tensor) -> Tensor:
        return s[0, 0] - 1.0

    rows = torch.arange(edges.shape[0])[:, None]
    terms = [
        ElementTerm("slack", slack, [("x", edges), ("s", rows)]),
        ElementTerm("small", small, [("s", rows)]),
        ElementTerm("held", held, [("x", torch.arange(16)[:, None])], data=(vertices,), linear=True),
    ]
    generator = torch.Generator().manual_seed(2)
    starts = {
        "x": vertices + 0.2 * torch.randn(3, 16, 3, dtype=DOUBLE, generator=generator),
        "s": 1.0 + 0.3 * torch.randn(3, edges.shape[0], 1, dtype=DOUBLE, generator=generator),
    }
    problem = GuidedProjection({name: block[0] for name, block in starts.items()}, terms, solver="scipy")
    alone = [problem.solve({name: block[i] for name, block in starts.items()}) for i in range(3)]
    together = problem.solve_batch(starts)
    assert_same(together, alone)
    for mine, other in zip(together, alone, strict=True):
        torch.testing.assert_close(mine.blocks["s"], other.blocks["s"], atol=1e-9, rtol=0)


def test_interruption_gives_every_member_its_best_state() -> None:
    problem, starts = net()
    calls = []

    def interrupt(x: Tensor) -> Tensor:
        calls.append(1)
        if len(calls) > 12:
            raise KeyboardInterrupt
        return stretched(x)

    terms = [*problem.terms[1:], ElementTerm("length", interrupt, problem.terms[0].stencil)]
    results = GuidedProjection({"x": starts[0]}, terms, solver="scipy").solve_batch({"x": starts})
    assert len(results) == len(starts)
    assert {result.status for result in results} == {Status.INTERRUPTED}
    for result in results:
        assert math.isfinite(result.merit)
        assert result.merit <= result.history[0].merit


def test_small_members_have_dense_factors_of_their_own() -> None:
    vertices, topology = wavy_grid(4, 4, triangles=True)
    term = ElementTerm("length", stretched, [("x", topology.edges)])
    problem = GuidedProjection({"x": vertices}, [term])
    results = problem.solve_batch({"x": vertices.expand(20, -1, -1).clone()})
    assert results[0].solver == "dense blocks"
    assert max(result.residuals[0].largest for result in results) < 1e-6


@pytest.mark.parametrize("shape", [(30, 3), (2, 29, 3), (2, 30, 2)])
def test_blocks_of_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    problem, _ = net()
    with pytest.raises(ShapeError, match="blocks"):
        problem.solve_batch({"x": torch.zeros(shape, dtype=DOUBLE)})


def test_an_empty_batch_has_no_results() -> None:
    problem, starts = net()
    assert problem.solve_batch({"x": starts[:0]}) == []


@pytest.mark.parametrize("chosen", [[2, 6], [6, 2]])
def test_members_that_go_on_without_the_others_take_their_state_along(chosen: list[int]) -> None:
    """Blocks, stiffness met, and inequalities heeded are those of the same member alone, in the order chosen."""
    problem, starts = net()
    together = problem.batched(7)
    state, _ = steps.step(together, steps.init(together, {"x": starts.flatten(0, 1)}))
    _, smaller = steps.of_members(problem, state, chosen)
    alone = [steps.step(problem, steps.init(problem, {"x": starts[member]}))[0] for member in chosen]
    assert not torch.equal(alone[0].heeded, alone[1].heeded)
    assert torch.equal(smaller.heeded, torch.cat([one.heeded for one in alone]))
    assert [course.merit for course in smaller.courses] == pytest.approx([one.merit for one in alone], rel=1e-9)
    for mine, others in (
        (smaller.blocks["x"], [one.blocks["x"] for one in alone]),
        (smaller.linearised.stiffness, [one.linearised.stiffness for one in alone]),
    ):
        torch.testing.assert_close(mine, torch.cat(others), atol=1e-9, rtol=0)


def test_the_matrix_of_a_batch_holds_that_of_every_member() -> None:
    """Two blocks, and elements that name a node twice; the fast way against a matrix for each member."""
    rows = torch.tensor([[0, 1], [2, 2], [3, 1]])

    def mixed(x: Tensor, s: Tensor) -> Tensor:
        return x[0, :2] * x[1, 1:] + s[0, 0] * s[1, 0]

    terms = [
        ElementTerm("mixed", mixed, [("x", rows), ("s", rows)]),
        ElementTerm("held", held, [("s", rows[:, :1])], data=(torch.ones(3, 1, dtype=DOUBLE),), linear=True),
    ]
    generator = torch.Generator().manual_seed(0)
    shapes = {"x": (4, 4, 3), "s": (4, 4, 1)}
    starts = {name: torch.randn(shape, dtype=DOUBLE, generator=generator) for name, shape in shapes.items()}
    problem = GuidedProjection({name: block[0] for name, block in starts.items()}, terms)
    batch = problem.batched(4)
    whole = batch.structure.linearise({name: block.flatten(0, 1) for name, block in starts.items()})
    lower = batch.structure.lower.matrix(whole.lower_values.numpy()).toarray()
    for member, unknowns in enumerate(batch.layout.member_unknowns().numpy()):
        one = problem.structure.linearise({name: block[member] for name, block in starts.items()})
        expected = problem.structure.lower.matrix(one.lower_values.numpy()).toarray()
        assert lower[unknowns[:, None], unknowns] == pytest.approx(expected, abs=1e-12)
        lower[unknowns[:, None], unknowns] = 0.0
    assert not lower.any()
    assert (batch.structure.lower.rows[batch.structure.lower.diagonal] == range(64)).all()


def test_batches_of_other_terms_are_not_those_of_the_terms_before() -> None:
    problem, starts = net()
    settings = ProjectionSettings(max_iterations=3)
    problem.solve_batch({"x": starts[:2]}, settings=settings)
    again = problem.with_terms([replace(term, weight=3.0 * term.weight + 1.0) for term in problem.terms])
    alone = [again.solve({"x": start}, settings=settings) for start in starts[:2]]
    assert_same(again.solve_batch({"x": starts[:2]}, settings=settings), alone)


def drawn(x: Tensor) -> Tensor:
    return x[0]


def drawn_gradient(x: Tensor) -> Tensor:
    """Not a number in a band: members that step into it stay there."""
    return torch.where((x[0, 0] - 5.0).abs() < 0.5, torch.nan, torch.eye(3).to(x))


@pytest.mark.parametrize("one_sided", [False, True])
@pytest.mark.parametrize(("solver", "count"), [("auto", 40), ("scipy", 100), ("cg", 40)])
def test_a_member_that_stays_singular_ends_alone(solver: str, count: int, one_sided: bool) -> None:
    """Steps halve the distance: from ten, members come to where a derivative is not a number."""
    nodes = torch.arange(count)[:, None]
    terms = [
        ElementTerm("drawn", drawn, [("x", nodes)], jacobian=drawn_gradient, weight=1e-3),
        ElementTerm("held", held, [("x", nodes)], data=(torch.ones(count, 3, dtype=DOUBLE),), weight=1e-6, linear=True),
        ElementTerm("length", stretched, [("x", torch.cat([nodes[1:], nodes[:-1]], 1))], weight=1e-6),
    ]
    if one_sided:
        terms.append(ElementTerm("ceiling", below, [("x", nodes)], weight=1e-6, loss=OneSided()))
    noise = 0.1 * torch.randn(5, count, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    starts = torch.tensor([1.0, 10.0, 2.0, 10.5, -3.0], dtype=DOUBLE)[:, None, None] + noise
    settings = ProjectionSettings(max_iterations=20, initial_damping=1e-3, damping_scale="identity", accuracy=1e-10)
    problem = GuidedProjection({"x": starts[0]}, terms, solver=solver)
    together = problem.solve_batch({"x": starts}, settings=settings)
    alone = [problem.solve({"x": start}, settings=settings) for start in starts]
    assert [number for number, one in enumerate(alone) if one.status is Status.SINGULAR] == [1, 3]
    assert [one.message for one in together] == [one.message for one in alone]
    assert_same(together, alone)
