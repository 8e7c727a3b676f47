"""Terms written for all elements at once, and problems whose index maps are kept: the same results as without."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import absolute_curvature_terms, even_fairness_terms
from torchfair.errors import ShapeError
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, SmoothAbsolute

SETTINGS = ProjectionSettings(max_iterations=4, initial_damping=1e-2, damping_scale="identity")


def stretch(x: Tensor, length: Tensor) -> Tensor:
    return torch.stack([(x[1] - x[0]).square().sum() - length**2, (x[1] - x[0]).sum()])


def stretches(x: Tensor, lengths: Tensor) -> Tensor:
    spokes = x[:, 1] - x[:, 0]
    return torch.stack([spokes.square().sum(1) - lengths**2, spokes.sum(1)], dim=1)


def edge_term(topology: Topology, length: float = 0.9, weight: float = 1.0) -> ElementTerm:
    lengths = torch.full((topology.num_edges,), length, dtype=torch.float64)
    loss = SmoothAbsolute(0.1)
    return ElementTerm("edges", stretch, [("vertices", topology.edges)], data=(lengths,), weight=weight, loss=loss)


def test_a_term_of_all_elements_at_once_equals_that_of_one() -> None:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    one = edge_term(topology)
    all_at_once = replace(one, residual=stretches, batched=True)
    arguments = one.arguments({"vertices": vertices})
    for mine, other in zip(one.linearised(arguments), all_at_once.linearised(arguments), strict=True):
        torch.testing.assert_close(mine, other, atol=1e-14, rtol=1e-14)


def test_more_components_than_unknowns_are_differentiated_forwards() -> None:
    index = torch.arange(4)[:, None]
    x = torch.linspace(0.1, 0.9, 4, dtype=torch.float64)[:, None]
    powers = torch.arange(1.0, 4.0, dtype=torch.float64)
    one = ElementTerm("powers", lambda x: x[0, 0] ** powers, [("x", index)])
    both = [one, replace(one, residual=lambda x: x[:, 0] ** powers, batched=True)]
    for term in both:
        jacobian = term.jacobians(term.arguments({"x": x}))
        torch.testing.assert_close(jacobian[:, :, 0], powers * x ** (powers - 1.0))


def problem_terms(vertices: Tensor, topology: Topology, smoothing: float, weight: float) -> list[ElementTerm]:
    return [
        *absolute_curvature_terms(topology, smoothing=smoothing),
        *even_fairness_terms(vertices, topology, weight=weight),
        edge_term(topology, weight=0.0),  # left out in both
        edge_term(topology, 1.0 - smoothing, weight),
    ]


@pytest.mark.parametrize("solver", ["scipy", "dense", "cg", "auto"])
def test_another_run_with_kept_index_maps_equals_a_fresh_one(solver: str) -> None:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    fixed = {"vertices": topology.is_boundary_vertex}
    blocks = {"vertices": vertices}
    first = GuidedProjection(blocks, problem_terms(vertices, topology, 0.3, 1.0), fixed=fixed, solver=solver)
    moved = first.solve(blocks, settings=SETTINGS).blocks
    terms = problem_terms(moved["vertices"], topology, 0.05, 0.2)
    again = first.with_terms(terms).solve(moved, settings=SETTINGS)
    fresh = GuidedProjection(blocks, terms, fixed=fixed, solver=solver).solve(moved, settings=SETTINGS)
    torch.testing.assert_close(again.blocks["vertices"], fresh.blocks["vertices"], atol=1e-10, rtol=0)
    assert again.residuals == fresh.residuals or solver == "cg"
    assert [row.name for row in again.residuals] == ["absolute curvature", "fairness", "edges"]
    # What was there before still is.
    back = first.solve(blocks, settings=SETTINGS)
    torch.testing.assert_close(back.blocks["vertices"], moved["vertices"], atol=1e-10, rtol=0)


def test_the_symbolic_analysis_is_kept() -> None:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    blocks = {"vertices": vertices}
    first = GuidedProjection(blocks, problem_terms(vertices, topology, 0.3, 1.0), solver="scipy")
    first.prepare()
    again = first.with_terms(problem_terms(vertices, topology, 0.1, 2.0))
    assert again.structure.lower is first.structure.lower
    assert again.structure.shares_pattern(first.structure)


def test_linear_terms_that_fill_other_places_get_their_own_pattern() -> None:
    x = torch.linspace(0.0, 1.0, 200, dtype=torch.float64)[:, None]
    pairs = torch.stack([torch.arange(199), torch.arange(1, 200)], 1)

    def chain(factor: float) -> list[ElementTerm]:
        factors = torch.full((199,), factor, dtype=torch.float64)
        data = (factors,)
        linear = ElementTerm("chain", lambda x, f: x[0, 0] - f * x[1, 0], [("x", pairs)], data=data, linear=True)
        return [linear, ElementTerm("held", lambda x: x[0, 0] - 1.0, [("x", torch.arange(200)[:, None])])]

    first = GuidedProjection({"x": x}, chain(0.0), solver="scipy")  # uncoupled: a diagonal matrix
    before = first.solve({"x": x}, settings=SETTINGS).blocks["x"]
    again = first.with_terms(chain(2.0))
    assert not again.structure.shares_pattern(first.structure)
    fresh = GuidedProjection({"x": x}, chain(2.0), solver="scipy")
    results = [problem.solve({"x": x}, settings=SETTINGS).blocks["x"] for problem in (again, fresh)]
    torch.testing.assert_close(*results, atol=1e-12, rtol=0)
    back = first.solve({"x": x}, settings=SETTINGS).blocks["x"]
    torch.testing.assert_close(back, before, atol=1e-12, rtol=0)


def test_other_stencils_are_refused() -> None:
    vertices, topology = wavy_grid(5, 5, triangles=True)
    first = GuidedProjection({"vertices": vertices}, [edge_term(topology)])
    other = replace(edge_term(topology), stencil=[("vertices", topology.edges.flip(0))])
    with pytest.raises(ShapeError, match="stencil"):
        first.with_terms([other])
    with pytest.raises(ShapeError, match="elements and a weight"):
        first.with_terms([edge_term(topology), edge_term(topology)])
