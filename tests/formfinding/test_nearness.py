"""Distances from the reference and back: what the job knows without searching is what a search finds."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.energies import angle_variation, total_mean_curvature
from torchfair.energies.angle_variation import lengths_times_angles
from torchfair.formfinding import FairSettings
from torchfair.formfinding.fair import measures
from torchfair.formfinding.fair.recipe import FairRecipe
from torchfair.geometry import ReferenceSurface
from torchfair.shapes import Torus, irregular_triangles


def closed() -> tuple[Tensor, Topology]:
    mesh = irregular_triangles(Torus(3.0, 1.0), 150)
    return mesh.vertices, mesh.topology


def with_an_isolated_vertex() -> tuple[Tensor, Topology]:
    vertices, topology = wavy_grid(5, 6)
    faces = topology.corners.reshape(-1, 4).tolist()
    return torch.cat([vertices[:2], vertices[:1] + 50.0, vertices[2:]]), Topology.from_faces(
        [[v + (v >= 2) for v in face] for face in faces], len(vertices) + 1
    )


STARTS = [closed, lambda: wavy_grid(7, 8), with_an_isolated_vertex]
BOUNDARIES = pytest.mark.parametrize("boundary", ["glide", "fixed"])


def searched(recipe: FairRecipe, vertices: Tensor) -> tuple[float, float]:
    """Largest distances from the input and back by a search for every point, in mean edges of the input."""
    start, topology = recipe.reference  # in the unit of the input
    used, own = topology.valences > 0, recipe.topology.valences > 0
    there = ReferenceSurface(recipe.unit.apply(start), topology).closest(recipe.unit.apply(vertices[own]))
    back = ReferenceSurface(recipe.unit.apply(vertices), recipe.topology).closest(recipe.unit.apply(start[used]))
    return tuple(float(found.distances.max()) / recipe.problem.input_edge for found in (there, back))


@BOUNDARIES
@pytest.mark.parametrize("start", STARTS)
def test_the_start_is_on_itself_and_its_surface_is_not_made_for_that(start, boundary) -> None:
    recipe = FairRecipe(*start(), settings=FairSettings(boundary=boundary))
    measures = recipe.before()
    assert measures["largest_distance"] == measures["largest_distance_back"] == 0.0
    assert "surface" not in vars(recipe.problem.near)
    assert searched(recipe, recipe.given) == (0.0, 0.0)


@pytest.mark.parametrize("most", [20.0, math.inf])
def test_the_surface_of_another_reference_is_made_once(most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was made to see how far it is, and once more to stay near it."""
    made: list[int] = []
    ready = ReferenceSurface.__init__
    monkeypatch.setattr(ReferenceSurface, "__init__", lambda *given: (made.append(1), ready(*given))[1])
    vertices, topology = wavy_grid(7, 8)
    settings = FairSettings(boundary="fixed", crease_angle=0.0, reference_distance=most)
    recipe = FairRecipe(vertices, topology, reference=(vertices * 1.001, topology), settings=settings)
    before = recipe.before()
    assert made == [1]
    assert before["largest_distance_relative"] == pytest.approx(searched(recipe, recipe.given)[0], rel=1e-12)
    made.clear()
    recipe.take_reference((vertices * 1.1, topology))  # is not taken for the one before
    other = recipe.before()
    assert made == [1]
    assert other["largest_distance_relative"] == pytest.approx(searched(recipe, recipe.given)[0], rel=1e-12)
    assert other["largest_distance_relative"] > 10.0 * before["largest_distance_relative"] > 0.0


def test_bends_of_edges_are_found_once_for_all_measures(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(
        measures, "lengths_times_angles", lambda *given: (asked.append(1), lengths_times_angles(*given))[1]
    )
    for vertices, topology in (closed(), wavy_grid(7, 8)):
        found = FairRecipe(vertices, topology).before()
        assert found["angle_variation"] == float(angle_variation(vertices, topology))
        assert found["total_mean_curvature"] == float(total_mean_curvature(vertices, topology))
    assert asked == [1, 1]


@pytest.mark.parametrize("by", [1e-12, 0.01, 3.0])
@pytest.mark.parametrize("start", STARTS)
def test_distances_of_another_mesh_are_those_of_a_search(start, by) -> None:
    recipe = FairRecipe(*start(), settings=FairSettings(boundary="fixed", crease_angle=0.0))
    noise = torch.randn(recipe.given.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    moved = recipe.given + by * recipe.unit.length * noise
    measures = recipe.measures(moved)
    there, back = searched(recipe, moved)
    assert measures["largest_distance_relative"] == pytest.approx(there, rel=1e-12, abs=1e-15)
    assert measures["largest_distance_back_relative"] == back


def test_one_vertex_that_moves_is_seen() -> None:
    recipe = FairRecipe(*closed())
    moved = recipe.given.clone()
    moved[-1] *= 1.01
    assert recipe.measures(moved)["largest_distance"] > 0.0


def test_finer_levels_are_measured_against_the_input() -> None:
    coarse = FairRecipe(*closed(), settings=FairSettings(crease_angle=0.0))
    finer = coarse.refined(coarse.state())
    measures = finer.before()
    there, back = searched(finer, finer.given)
    assert measures["largest_distance_relative"] == pytest.approx(there, rel=1e-12)
    assert measures["largest_distance_back_relative"] == back > 0.0
