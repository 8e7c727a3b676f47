"""Polygons whose sides cross each other, and steps that make such ones."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, minimise_normal_variation
from torchfair.formfinding.fair import crossing_sides as module
from torchfair.formfinding.fair import planarity_goal
from torchfair.formfinding.fair.crossing_sides import crossing_sides
from torchfair.formfinding.fair.measures import fair_measures
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job.pulls import Pulls
from torchfair.geometry._polygon_sides import sides_cross
from torchfair.normalisation import Normalisation

HOUSE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.55, 1.5], [0.45, 1.5]]  # with a short ridge
PENTAGON = Topology.from_faces([[0, 1, 2, 3, 4]])


def polygon(corners: list[list[float]]) -> Tensor:
    """(n, 3) in a plane that is none of the coordinates'."""
    flat = torch.tensor(corners, dtype=torch.float64)
    axes = torch.tensor([[2.0, -1, 2], [2, 2, -1]], dtype=torch.float64) / 3
    return flat @ axes


def ridge_reversed() -> list[list[float]]:
    """The house with the ends of its ridge exchanged: its area looks the same way, and no angle is below 45 degrees."""
    return [*HOUSE[:3], HOUSE[4], HOUSE[3]]


def test_a_short_side_that_is_reversed_crosses_its_neighbours() -> None:
    for corners, crosses in ((HOUSE, False), (ridge_reversed(), True)):
        for turn, backwards in itertools.product(range(5), (False, True)):
            turned = torch.arange(5).roll(turn)
            turned = turned.flip(0) if backwards else turned
            assert crossing_sides(polygon(corners)[turned], PENTAGON).tolist() == [crosses]


@pytest.mark.parametrize("size", [4, 5, 6, 7])
def test_of_all_orders_of_corners_on_an_ellipse_only_the_convex_one_has_no_sides_that_cross(size: int) -> None:
    angles = [2 * math.pi * (k + 0.3 * math.sin(7 * k)) / size for k in range(size)]
    corners = polygon([[2 * math.cos(angle), math.sin(angle)] for angle in angles])
    topology = Topology.from_faces([list(range(size))])
    for rest in itertools.permutations(range(1, size)):
        order = [0, *rest]
        steps = {(b - a) % size for a, b in itertools.pairwise([*order, 0])}
        convex = steps in ({1}, {size - 1})
        assert crossing_sides(corners[order], topology).tolist() == [not convex], order


def test_sides_that_touch_do_not_cross_and_triangles_have_none() -> None:
    touching = polygon([[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]])
    assert crossing_sides(touching, PENTAGON).tolist() == [False]
    assert crossing_sides(touching, Topology.from_faces([[0, 1, 2], [0, 2, 4]], 5)).tolist() == [False, False]


def pressed(depth: float, turn: int = 0) -> Tensor:
    """A quad of which the last corner lies so far beyond the second side, as a share of its size, somewhere."""
    corners = polygon([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0 + depth * math.sqrt(2), 0.4]])
    axes = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(turn))).Q
    return 100 * corners @ axes + torch.tensor([7.0, 3.0, -5.0], dtype=torch.float64)


def test_corners_pressed_against_a_side_touch_it_whatever_rounding_says() -> None:
    quad = Topology.from_faces([[0, 1, 2, 3]])
    by_rounding = [bool(crossing_sides(pressed(0.0, turn), quad)) for turn in range(40)]
    assert 5 < sum(by_rounding) < 35
    for turn in range(40):
        assert not crossing_sides(pressed(0.0, turn), quad, 1e-9).any()
        assert not crossing_sides(pressed(0.9e-9, turn), quad, 1e-9).any()
        assert crossing_sides(pressed(1.1e-9, turn), quad, 1e-9).all()
        assert not crossing_sides(pressed(-1e-3, turn), quad, 1e-9).any()


def test_what_is_promised_of_faces_that_cross_themselves_does_not_depend_on_rounding() -> None:
    quad, settings = Topology.from_faces([[0, 1, 2, 3]]), FairSettings(boundary="free", smallest_area=0.1)
    problem = FairProblem(pressed(-0.1), quad, None, Pulls(pressed(-0.1)), settings)
    for turn in range(8):
        measured = fair_measures(pressed(0.0, turn), pressed(-0.1, turn), problem, Normalisation.of(pressed(0.0), quad))
        assert measured["crossing_faces"] == 0
    measured = fair_measures(pressed(1e-6), pressed(-0.1), problem, Normalisation.of(pressed(0.0), quad))
    assert measured["crossing_faces"] == 1


@pytest.mark.parametrize("pairs", [1, 60, 1 << 20])
def test_many_polygons_at_once_are_as_each_alone(monkeypatch: pytest.MonkeyPatch, pairs: int) -> None:
    monkeypatch.setattr(module, "_PAIRS", pairs)
    generator = torch.Generator().manual_seed(5)
    sizes = torch.randint(3, 8, (60,), generator=generator).tolist()
    corners = torch.randn(sum(sizes), 3, dtype=torch.float64, generator=generator)
    parts = corners.split(sizes)
    faces = [list(part) for part in torch.arange(len(corners)).split(sizes)]
    alone = [bool(crossing_sides(part, Topology.from_faces([list(range(len(part)))]))) for part in parts]
    assert crossing_sides(corners, Topology.from_faces([[int(v) for v in face] for face in faces])).tolist() == alone
    assert 10 < sum(alone) < 50


def test_a_step_after_which_sides_cross_is_refused() -> None:
    start, reversed_ = polygon(HOUSE), polygon(ridge_reversed())
    settings = FairSettings(boundary="free", smallest_area=0.1, smallest_edge=0.0)
    problem = FairProblem(start, PENTAGON, None, Pulls(start), settings)
    states = {"start": {"vertices": start}, "reversed": {"vertices": reversed_}}
    wider = {"vertices": polygon([*HOUSE[:3], [0.6, 1.5], [0.4, 1.5]])}
    assert problem.guard.keeps_bounds(states["reversed"])  # angles, area and lengths are good
    assert problem.keeps_faces(states["start"], wider)
    assert not problem.keeps_faces(states["start"], states["reversed"])
    assert problem.keeps_faces(states["reversed"], states["reversed"])  # what crosses already may


def test_faces_that_may_turn_may_have_sides_that_cross() -> None:
    start = polygon(HOUSE)
    settings = FairSettings(boundary="free", faces_may_turn=True)
    problem = FairProblem(start, PENTAGON, None, Pulls(start), settings)
    assert problem.keeps_faces({"vertices": start}, {"vertices": polygon(ridge_reversed())})


def house_recipe() -> FairRecipe:
    settings = FairSettings(boundary="free", smallest_area=0.1, smallest_edge=0.0, distance_limit=2.0)
    return FairRecipe(polygon(HOUSE), PENTAGON, settings=settings)


@pytest.mark.parametrize("first", [0, 2, 3])
@pytest.mark.parametrize("warped", [False, True])
def test_once_sides_cross_after_a_stage_all_is_done_anew_with_none_that_cross(first: int, warped: bool) -> None:
    """But where faces could not become planar, E alone is lowered then, as it was."""
    recipe = house_recipe()
    begin, crossed = recipe.start, recipe.unit.apply(polygon(ridge_reversed()))
    notes, planarity = list(recipe.problem.notes), recipe.problem.planarity
    plan = recipe.plan(recipe.state())
    allowed, begun = [], []
    for stage in plan.stages():
        assert stage.guard is not None
        allowed.append(stage.guard({"vertices": begin}, {"vertices": crossed}))
        begun.append(stage.blocks["vertices"])
        if allowed[-1]:
            recipe.problem.notes.append("what it cost")
            planarity.distance, planarity.most_warped = 9.0, 0.1 if warped else math.inf
        plan.state = {"vertices": crossed if len(allowed) - 1 == first else begin}
    again = (1 if warped and first else 3) if first < 3 else 0  # after the first that one is done again, and the others
    assert allowed == [True] * min(first + 1, 3) + [False] * again
    assert torch.equal(plan.state["vertices"], begin)
    assert not recipe.problem.admits({"vertices": begin}, {"vertices": crossed})
    if again:
        assert torch.equal(begun[first + 1], begin)
        assert recipe.problem.notes == notes
        assert planarity.distance == 0.0


@pytest.mark.parametrize("first", [0, 2, 3])
def test_the_first_stage_after_which_sides_cross_is_done_again_alone(first: int) -> None:
    """As all would be from the start: no step of those before was another."""
    recipe = house_recipe()
    begin, crossed = recipe.start, recipe.unit.apply(polygon(ridge_reversed()))
    notes, planarity = list(recipe.problem.notes), recipe.problem.planarity
    plan = recipe.plan(recipe.state())
    stages, states = [], []
    for number, stage in enumerate(plan.stages()):
        stages.append(stage)
        states.append(plan.state["vertices"])
        assert recipe.problem.sides_may_cross == (number <= first)
        if number in (first, first + 1):
            recipe.problem.notes.append("what it cost")
            assert planarity.distance == 0.0
            planarity.distance = 9.0
        plan.state = {"vertices": crossed if number == first else begin + 0.001 * (number + 1)}
    again = first < 3
    assert len(stages) == 3 + again
    if again:
        assert stages[first + 1] is stages[first]
        assert torch.equal(states[first + 1], states[first])
        assert recipe.problem.notes == [*notes, "what it cost"]
        assert stages[-1].guard is not None
        assert not stages[-1].guard({"vertices": begin}, {"vertices": crossed})


def test_no_start_where_planes_meet_has_sides_that_cross(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = house_recipe()
    wider = [*HOUSE[:3], [0.6, 1.5], [0.4, 1.5]]
    for corners, fits in ((ridge_reversed(), False), (wider, True)):
        moved = recipe.unit.apply(polygon(corners))
        monkeypatch.setattr(planarity_goal, "on_face_planes", lambda *_, moved=moved: moved)
        found = recipe.problem.planarity.where_planes_meet(recipe.start)
        assert (found is not None and torch.equal(found, moved)) == fits


def test_far_from_the_origin_polygons_of_whole_numbers_cross_where_they_did() -> None:
    generator = np.random.default_rng(3)
    corners = np.pad(generator.integers(0, 4, (300, 6, 2)), ((0, 0), (0, 0), (0, 1))).astype(float)
    up = np.broadcast_to([0.0, 0.0, 1.0], (300, 3))
    crossing = sides_cross(corners, up)
    assert 50 < crossing.sum() < 250
    assert np.array_equal(sides_cross(corners + 2.0**51, up), crossing)


def test_faces_whose_sides_cross_are_counted_and_no_more_than_at_the_start_are_promised() -> None:
    for corners, count in ((HOUSE, 0), (ridge_reversed(), 1)):
        settings = FairSettings(boundary="fixed", smallest_area=0.1, smallest_edge=0.0)
        result = minimise_normal_variation(polygon(corners), PENTAGON, settings=settings)
        assert result.after["crossing_faces"] == count
        (promise,) = (promise for promise in result.promises if promise.name == "faces that cross themselves")
        assert (promise.asked, promise.reached, promise.holds) == (count, count, True)
