"""Sums, jacrev, jacfwd and closed forms are the same derivative, for every ready-made term; and a solve by each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import pytest
import torch
from helpers import DOUBLE
from term_cases import CASES, triangles
from torch import Tensor

from torchfair import constraints as c
from torchfair.errors import ShapeError, TorchfairError
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, guided_projection
from torchfair.projection.differentiation import AutomaticWay, Way

CPU = torch.device("cpu")
AUTOMATIC: tuple[AutomaticWay, ...] = get_args(AutomaticWay)


@pytest.mark.parametrize("way", get_args(Way))
@pytest.mark.parametrize("name", CASES)
def test_all_ways_agree_with_the_default_for_every_term(name: str, way: Way) -> None:
    for state, terms in CASES[name](CPU):
        for term in terms:
            if way == "closed form" and term.jacobian is None:
                continue
            term.arguments({key: 0.99 * block for key, block in state.items()})  # some remember the state before
            arguments = term.arguments(state)
            values, expected = term.linearised(arguments)
            found_values, found = replace(term, derivatives=way).linearised(arguments)
            torch.testing.assert_close(found_values, values, rtol=1e-12, atol=1e-13)
            assert found.shape == expected.shape
            assert not found.requires_grad
            torch.testing.assert_close(found, expected, rtol=1e-8, atol=1e-9 * float(expected.abs().max()))


def stretched(x: Tensor, length: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - length


def wrong(x: Tensor, length: Tensor) -> Tensor:
    return 0.0 * torch.cat([x[0], x[1]])


def spring(**options: object) -> ElementTerm:
    index, lengths = torch.tensor([[0, 1], [1, 2]]), torch.ones(2, dtype=DOUBLE)
    return ElementTerm("spring", stretched, [("x", index)], data=(lengths,), **options)  # type: ignore[arg-type]


POINTS = {"x": torch.tensor([[0.0, 0, 0], [1.5, 0.2, 0], [2.0, 1.0, 0.5]], dtype=DOUBLE)}


@pytest.mark.parametrize("way", AUTOMATIC)
def test_a_closed_form_is_passed_over_where_another_way_is_asked_for(way: Way) -> None:
    term = spring(jacobian=wrong, derivatives=way)
    arguments = term.arguments(POINTS)
    torch.testing.assert_close(term.jacobians(arguments), spring().jacobians(arguments))
    assert guided_projection(POINTS, [term]).merit < 1e-12
    with pytest.raises(TorchfairError, match="is not the derivative"):
        guided_projection(POINTS, [spring(jacobian=wrong)])


@pytest.mark.parametrize("way", [None, *get_args(Way)])
def test_a_problem_is_solved_alike_in_every_way(way: Way | None) -> None:
    vertices, topology = triangles(CPU)
    terms = [*c.normal_variation_terms(topology, smoothing=0.1), *c.interior_fairness_terms(topology, weight=0.5)]
    terms += c.handle_terms(torch.arange(25), vertices, weight=1.0)
    settings = ProjectionSettings(max_iterations=5, solver="dense")
    expected = guided_projection({"vertices": vertices}, terms, settings=settings)
    found = guided_projection({"vertices": vertices}, terms, settings=settings, derivatives=way)
    torch.testing.assert_close(found.blocks["vertices"], expected.blocks["vertices"], rtol=0, atol=1e-9)
    assert [row.name for row in found.residuals] == [row.name for row in expected.residuals]


def test_a_problem_keeps_its_way_for_other_terms_members_and_solvers() -> None:
    asked: list[int] = []

    def closed(x: Tensor, length: Tensor) -> Tensor:
        asked.append(1)
        edge = (x[1] - x[0]) / torch.linalg.vector_norm(x[1] - x[0])
        return torch.cat([-edge, edge])

    term = spring(jacobian=closed)
    problem = GuidedProjection(POINTS, [term], derivatives="jacrev")
    others: list[Any] = [problem, problem.with_terms([replace(term, weight=2.0)]), problem.solved_by("dense")]
    for other in others:
        other.solve(POINTS, settings=ProjectionSettings(solver=other.solver))
    problem.solve_batch({"x": torch.stack([POINTS["x"], 2.0 * POINTS["x"]])})
    assert not asked
    GuidedProjection(POINTS, [term], derivatives="closed form").solve(POINTS)
    assert asked


@pytest.mark.parametrize("way", AUTOMATIC)
def test_no_elements_and_many_components_are_no_exception(way: Way) -> None:
    none = torch.zeros(0, 2, dtype=torch.int64)
    empty = ElementTerm("none", lambda x: x[0] - x[1], [("x", none)], derivatives=way)
    values, jacobians = empty.linearised(empty.arguments(POINTS))
    assert values.shape[0] == jacobians.shape[0] == 0
    many = ElementTerm("many", lambda x: torch.cat([x[0], x[0] ** 2]), [("x", torch.tensor([[1]]))], derivatives=way)
    values, jacobians = many.linearised(many.arguments(POINTS))
    expected = torch.cat([torch.eye(3, dtype=DOUBLE), torch.diag(2.0 * POINTS["x"][1])])
    torch.testing.assert_close(jacobians[0], expected)


@pytest.mark.parametrize("way", AUTOMATIC)
def test_a_residual_that_does_not_depend_on_its_unknowns_is_refused_in_every_way(way: Way) -> None:
    term = ElementTerm("lost", lambda x: x[0].detach(), [("x", torch.tensor([[1]]))], derivatives=way)
    with pytest.raises(TorchfairError, match="term 'lost' does not depend on its unknowns"):
        guided_projection(POINTS, [term])


def test_mistakes_are_named() -> None:
    with pytest.raises(ShapeError, match=r"term 'spring', derivatives: expected one of closed form, sums, jacrev"):
        guided_projection(POINTS, [spring(derivatives="jacobian")])
    with pytest.raises(ShapeError, match=r"term 'spring', derivatives: expected a jacobian"):
        guided_projection(POINTS, [spring(derivatives="closed form")])
    with pytest.raises(ShapeError, match=r"problem, derivatives: expected one of closed form"):
        guided_projection(POINTS, [spring()], derivatives="central")  # type: ignore[arg-type]
