"""Large meshes are solved by conjugate gradients where nothing stiff is asked for, and end as low."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, minimise_normal_variation
from torchfair.formfinding.fair import iterative
from torchfair.formfinding.job.session import Session
from torchfair.shapes import Torus, icosphere, irregular_triangles


@pytest.fixture
def small_is_large(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Every mesh counts as large."""
    monkeypatch.setattr(iterative, "_FEWEST", 1)
    return monkeypatch


def solvers(recipe: FairRecipe) -> list[object]:
    """Of all stages of a recipe, in their order."""
    return [stage.settings.solver for stage in recipe.plan(recipe.state()).stages()]


def sphere() -> tuple[Tensor, Topology]:
    mesh = icosphere(2)
    return mesh.vertices, mesh.topology


def test_meshes_of_so_many_vertices_take_conjugate_gradients_in_every_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = sphere()
    assert solvers(FairRecipe(vertices, topology)) == ["auto"] * 3
    monkeypatch.setattr(iterative, "_FEWEST", len(vertices) + 1)
    assert solvers(FairRecipe(vertices, topology)) == ["auto"] * 3
    monkeypatch.setattr(iterative, "_FEWEST", len(vertices))
    assert solvers(FairRecipe(vertices, topology)) == ["cg"] * 3


def test_another_solver_that_is_asked_for_stays(small_is_large: pytest.MonkeyPatch) -> None:
    settings = FairSettings()
    settings = replace(settings, projection=replace(settings.projection, solver="scipy"))
    assert solvers(FairRecipe(*sphere(), settings=settings)) == ["scipy"] * 3


def test_what_is_stiff_or_has_other_polygons_keeps_factors(small_is_large: pytest.MonkeyPatch) -> None:
    vertices, topology = sphere()
    lifted = FairSettings(formulation="lifted")
    assert set(solvers(FairRecipe(vertices, topology, settings=lifted))) == {"auto"}
    assert set(solvers(FairRecipe(vertices, topology, settings=FairSettings.paper()))) == {"auto"}
    every = replace(FairSettings.paper(), formulation="reduced")
    assert set(solvers(FairRecipe(vertices, topology, settings=every))) == {"auto"}
    handle = {3: (1.01 * vertices[3]).tolist()}
    assert set(solvers(FairRecipe(vertices, topology, handles=handle))) == {"auto"}
    loose = FairSettings(planar="none")
    assert set(solvers(FairRecipe(*wavy_grid(7, 6, triangles=True), settings=loose))) == {"cg"}
    assert set(solvers(FairRecipe(*wavy_grid(7, 6), settings=loose))) == {"auto"}
    flat = FairRecipe(vertices, topology, settings=FairSettings(flat=(4,)))
    assert set(solvers(flat)) == {"auto"}


def test_a_solve_by_conjugate_gradients_ends_as_low_and_says_so(small_is_large: pytest.MonkeyPatch) -> None:
    mesh = irregular_triangles(Torus(2.0, 0.8), 400)
    by_cg = minimise_normal_variation(mesh.vertices, mesh.topology)
    assert by_cg.projection.solver == "conjugate gradients"
    assert by_cg.holds
    small_is_large.setattr(iterative, "_FEWEST", 10**9)
    by_factors = minimise_normal_variation(mesh.vertices, mesh.topology)
    assert by_factors.projection.solver != by_cg.projection.solver
    assert by_cg.after["normal_variation"] == pytest.approx(by_factors.after["normal_variation"], rel=5e-3)


def test_live_steps_keep_their_solver_beside_a_whole_solve(small_is_large: pytest.MonkeyPatch) -> None:
    quick = replace(FairSettings().projection, max_iterations=2)
    recipe = FairRecipe(*sphere(), settings=FairSettings(projection=quick))
    session = Session(recipe, live=True)
    session.step()
    session.solve()
    session.step()
    names = {problem.solver.name for problem in session._problems.all()}
    assert session.runs[-1].solver == "conjugate gradients"
    assert len(names) == 2
    following = session._following
    assert following is not None
    assert following.problem.solver.name != "conjugate gradients"
