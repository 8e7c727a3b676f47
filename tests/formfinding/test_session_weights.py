"""Weights that are turned in a live session: each is the weight of a job that has it from the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from helpers import grid_faces
from session_steps import MIDDLE, above, drag, opened, sheet

from torchfair import Topology
from torchfair.formfinding import (
    FairRecipe,
    FairSettings,
    Session,
)


def test_index_maps_and_analysis_are_kept_whatever_is_steered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Handles, held vertices and weights are data: nothing is compiled after the first step."""
    from torchfair.formfinding.job import compiled_problems as module

    session = opened()
    session.step()
    made: list[int] = []
    original: Callable[..., object] = module.GuidedProjection
    monkeypatch.setattr(module, "GuidedProjection", lambda *a, **k: made.append(1) or original(*a, **k))
    before = session._problems.all()[0]
    drag(session)
    session.hold([3])
    session.step()
    session.free([3])
    session.weigh(fairness=0.7, closeness=3.0)
    session.move({5: above(session, 0.1, 5)})
    session.step()
    session.settle()
    after = session._problems.all()[0]
    assert not made
    assert after.structure.lower is before.structure.lower


def test_weights_act_on_the_running_solve() -> None:
    """More fairness, evener edges."""
    spreads = []
    for weight in (0.01, 30.0):
        session = opened(distance_limit=None)
        session.step()
        session.weigh(fairness=weight, closeness=0.1)
        for _ in range(10):
            session.step()
        ends = session.vertices[session.recipe.topology.edges]
        spreads.append(float((ends[:, 0] - ends[:, 1]).norm(dim=1).std()))
    assert spreads[1] < spreads[0]


def test_weights_come_and_go() -> None:
    """Terms without a weight are none; the merit has them again where their weights are back."""

    def kinds(session: Session[FairRecipe]) -> set[str]:
        problem, *_ = session._problems.all()
        return {term.name for term in problem.structure.terms}

    session = opened()
    for weights, there in (({"closeness": 0.0}, False), ({"closeness": 20.0, "fairness": 0.0}, True)):
        session.weigh(**weights)
        assert session.step().accepted
        assert ("closeness" in kinds(session)) is there
    assert "fairness" not in kinds(session)
    assert not session.settle()


WEIGHTS = [name.removesuffix("_weight") for name in vars(FairSettings()) if name.endswith("_weight")]


@pytest.mark.parametrize("formulation", ["reduced", "lifted"])
@pytest.mark.parametrize("name", WEIGHTS)
def test_a_weight_that_is_turned_is_the_weight_of_a_job_that_has_it_from_the_start(name: str, formulation: str) -> None:
    vertices, topology = sheet()
    given = {"formulation": formulation, "planar": "quads", "directions": "keep", "flat": (0, 1)}
    if name == "free_boundary":
        given["boundary"] = "free"
    settings = FairSettings(**given)  # type: ignore[arg-type]
    quads = Topology.from_faces(grid_faces(7, 7)) if name == "planarity" else topology

    def felt(recipe: FairRecipe) -> list[tuple[str, float]]:
        return [(term.name, term.weight) for term in recipe.problem.terms(1.0)]

    session = Session(FairRecipe(vertices, quads, handles={MIDDLE: vertices[MIDDLE].tolist()}, settings=settings))
    before = felt(session.recipe)
    session.weigh(**{name: 7.0})
    turned = replace(settings, **{f"{name}_weight": 7.0})
    fresh = FairRecipe(vertices, quads, handles={MIDDLE: vertices[MIDDLE].tolist()}, settings=turned)
    assert felt(session.recipe) == felt(fresh)
    assert felt(session.recipe) != before or (name == "constraint" and formulation == "reduced")


def test_without_the_weight_of_quality_no_bound_of_faces_is_kept() -> None:
    session = opened()
    problem = session.recipe.problem
    thin = problem.vertices.clone()
    thin[MIDDLE] = 0.98 * thin[MIDDLE + 1] + 0.02 * thin[MIDDLE]
    assert not problem.guard.keeps_bounds({"vertices": thin})
    session.weigh(quality=0.0)
    assert problem.guard.keeps_bounds({"vertices": thin})
