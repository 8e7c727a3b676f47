"""Polygons whose sides cross each other, and steps that make such ones."""

from __future__ import annotations

import itertools
import math

import pytest
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairSettings
from torchfair.formfinding.fair import crossing_sides as module
from torchfair.formfinding.fair.crossing_sides import crossing_sides
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job.pulls import Pulls

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
    assert problem.guard.keeps_faces(states["start"], wider)
    assert not problem.guard.keeps_faces(states["start"], states["reversed"])
    assert problem.guard.keeps_faces(states["reversed"], states["reversed"])  # what crosses already may


def test_faces_that_may_turn_may_have_sides_that_cross() -> None:
    start = polygon(HOUSE)
    settings = FairSettings(boundary="free", faces_may_turn=True)
    problem = FairProblem(start, PENTAGON, None, Pulls(start), settings)
    assert problem.guard.keeps_faces({"vertices": start}, {"vertices": polygon(ridge_reversed())})
