"""Polygons become planar wherever the mesh allows it; where it does not, that is said and nothing is made worse."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pytest
import torch
from helpers import DOUBLE
from honeycombs import honeycomb
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, minimise_normal_variation
from torchfair.formfinding.fair import planarity_goal
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job.plan import Stage
from torchfair.geometry import corner_angles
from torchfair.geometry.planarity import planarity
from torchfair.projection.layout import State


def quad(warp: float) -> tuple[Tensor, Topology]:
    """A unit square whose diagonals are ``warp`` apart."""
    heights = 0.5 * warp * torch.tensor([-1.0, 1.0, -1.0, 1.0], dtype=DOUBLE)
    plane = torch.tensor([[0.0, 0], [1, 0], [1, 1], [0, 1]], dtype=DOUBLE)
    return torch.cat([plane, heights[:, None]], 1), Topology.from_faces([[0, 1, 2, 3]])


def stages(monkeypatch: pytest.MonkeyPatch) -> tuple[list[float], list[int]]:
    """Shares of the stages that lower E, and before each one without E how many of these there were."""
    shares: list[float] = []
    planar: list[int] = []
    stage, planar_stage = FairProblem.stage, FairProblem.planar_stage

    def noted(problem: FairProblem, state: State, share: float, *others: Any) -> Stage:
        shares.append(share)
        return stage(problem, state, share, *others)

    def noted_planar(problem: FairProblem, state: State, share: float) -> Stage:
        planar.append(len(shares))
        return planar_stage(problem, state, share)

    monkeypatch.setattr(FairProblem, "stage", noted)
    monkeypatch.setattr(FairProblem, "planar_stage", noted_planar)
    return shares, planar


def smallest(vertices: Tensor, topology: Topology) -> float:
    return math.degrees(float(corner_angles(vertices, topology).min()))


def only(measures: Mapping[str, float], name: str) -> float:
    return float(measures[name])


def test_one_quad_becomes_planar_beyond_the_distance_limit_and_says_so() -> None:
    """Its corners would all stay, and are 0.07 from the plane between them."""
    vertices, topology = quad(0.14)
    settings = FairSettings(planar="quads", continuation=())
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert float(planarity(result.vertices, topology).max()) < 1e-4
    assert result.holds
    assert 0.05 < only(result.after, "largest_distance_relative") < 0.08
    assert any("beyond the distance limit" in note for note in result.notes)
    assert smallest(result.vertices, topology) > 80.0


def test_what_cannot_become_planar_is_named_and_left_as_it_was() -> None:
    vertices, topology = quad(0.14)
    settings = FairSettings(planar="quads", boundary="fixed")
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert torch.equal(result.vertices, vertices)
    assert not result.holds
    (note,) = (note for note in result.notes if "NOT REACHED" in note)
    assert "planarity of kept faces 0.139" in note
    assert "1 of 1: faces 0 (0.14)" in note


def test_weights_that_cannot_make_faces_planar_are_not_raised_further(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within the limit none can: after the whole weight they are made planar beyond it, and E is lowered there.

    As it is where fewer faces are so far from planar.
    """
    monkeypatch.setattr(planarity_goal, "_LARGEST_MEAN_WARP", math.inf)
    shares, planar = stages(monkeypatch)
    settings = FairSettings(planar="quads", continuation=())
    result = minimise_normal_variation(*quad(0.4), settings=settings)
    assert result.holds
    assert planar[0] == 8
    assert shares[:8] == pytest.approx([(number + 1) / 8 for number in range(8)])


def test_faces_that_cannot_become_planar_even_without_e_are_not_tried_with_e(monkeypatch: pytest.MonkeyPatch) -> None:
    """All five weights of planarity alone, then E is lowered at the weak one."""
    shares, planar = stages(monkeypatch)
    vertices, topology = quad(0.4)
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(planar="quads", boundary="fixed"))
    assert not result.holds
    assert torch.equal(result.vertices, vertices)
    assert planar == [0] * 5
    assert shares == pytest.approx([1 / 3])


@pytest.mark.parametrize("reference", [False, True])
def test_faces_that_can_become_planar_come_out_as_if_that_had_not_been_asked_first(
    monkeypatch: pytest.MonkeyPatch, reference: bool
) -> None:
    vertices, topology = quad(0.4)
    settings, surface = FairSettings(planar="quads", continuation=()), (vertices, topology) if reference else None
    _, planar = stages(monkeypatch)
    asked = minimise_normal_variation(vertices, topology, reference=surface, settings=settings)
    assert planar[0] == 0
    monkeypatch.setattr(planarity_goal, "_LARGEST_MEAN_WARP", math.inf)
    plain = minimise_normal_variation(vertices, topology, reference=surface, settings=settings)
    assert asked.holds
    assert torch.equal(asked.vertices, plain.vertices)
    assert asked.notes == plain.notes


@pytest.mark.parametrize(
    ("warp", "settings", "handles", "far"),
    [
        (0.11, FairSettings(planar="quads"), None, True),
        (0.09, FairSettings(planar="quads"), None, False),
        (0.09, FairSettings(planar="quads", distance_limit=0.04), None, True),
        (0.045, FairSettings(planar="quads", distance_limit=0.01), None, False),
        (0.11, FairSettings(planar="quads", distance_limit=None), None, False),
        (0.11, FairSettings(planar="keep"), None, False),
        (0.11, FairSettings(planar="quads"), {0: [0.0, 0.0, 1.0]}, False),
    ],
)
def test_faces_are_far_from_planar_whose_corners_would_go_beyond_the_limit(
    warp: float, settings: FairSettings, handles: dict[int, list[float]] | None, far: bool
) -> None:
    """By half of what their diagonals are apart; where it is known how far that is, and no handles pull."""
    recipe = FairRecipe(*quad(warp), settings=settings, handles=handles)
    assert recipe.problem.planarity.is_far(recipe.start) is far


def test_vertices_off_the_surface_have_room_while_e_is_lowered() -> None:
    """A quarter of their distance, but no more than the farthest; the limit where they are within it."""
    vertices, topology = quad(0.0)
    recipe = FairRecipe(vertices, topology, settings=FairSettings(planar="quads", distance_limit=0.05))
    near, lifted = recipe.problem.near, recipe.start.clone()
    lifted[:, 2] += torch.tensor([0.01, 0.1, 0.15, 0.16], dtype=DOUBLE)
    near.lift(lifted, room=1.25)
    assert near.allowed is not None
    assert near.allowed.tolist() == pytest.approx([0.05, 0.125, 0.16, 0.16])
    near.lift(lifted)
    assert near.allowed.tolist() == pytest.approx([0.05, 0.1, 0.15, 0.16])
    # An isolated vertex is not among those that are far.
    lone = FairRecipe(
        torch.cat([vertices, torch.full((1, 3), 9.0, dtype=DOUBLE)]),
        Topology.from_faces(topology.face_lists(), num_vertices=5),
        settings=FairSettings(planar="quads", distance_limit=0.05),
    )
    apart = torch.cat([lifted, torch.full((1, 3), 9.0, dtype=DOUBLE)])
    lone.problem.near.lift(apart, room=1.25)
    assert lone.problem.near.allowed is not None
    assert lone.problem.near.allowed[:4].tolist() == pytest.approx([0.05, 0.125, 0.16, 0.16])
    near.lift(lifted, 0.155)
    assert near.allowed.tolist() == pytest.approx([0.155, 0.155, 0.155, 0.16])


@pytest.mark.slow
def test_the_distance_limit_can_be_insisted_on() -> None:
    vertices, topology = quad(0.14)
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(planar="quads", planar_distance=0.0))
    assert only(result.after, "largest_distance_relative") <= 0.05 * (1 + 1e-6)
    assert not result.holds
    assert float(planarity(result.vertices, topology).max()) <= float(planarity(vertices, topology).max())


@pytest.mark.slow
@pytest.mark.parametrize("amplitude", [0.03, 0.12, -0.12])
def test_hexagons_on_a_saddle_become_planar(amplitude: float) -> None:
    """All but six vertices are corners of the boundary."""
    vertices, topology = honeycomb(amplitude)
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(planar="quads"))
    assert float(planarity(result.vertices, topology).max()) < 1e-4
    assert result.holds


@pytest.mark.slow
def test_hexagons_between_fixed_vertices_are_no_worse_than_before() -> None:
    vertices, topology = honeycomb(0.12)
    settings = FairSettings(planar="quads", boundary="fixed")
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert not result.holds
    assert float(planarity(result.vertices, topology).max()) <= float(planarity(vertices, topology).max()) * (1 + 1e-9)
    assert result.after["normal_variation"] <= result.before["normal_variation"] * (1 + 1e-9)
    assert any("of 7: faces " in note for note in result.notes)


def test_corners_of_faces_that_are_planar_stay() -> None:
    """Only warped faces take corners of the boundary along."""
    (first, topology), (second, _) = quad(0.0), quad(0.1)
    vertices = torch.cat([first, second + torch.tensor([5.0, 0.0, 0.0], dtype=DOUBLE)])
    both = Topology.from_faces([[0, 1, 2, 3], [4, 5, 6, 7]])
    result = minimise_normal_variation(vertices, both, settings=FairSettings(planar="quads"))
    assert torch.equal(result.vertices[:4], vertices[:4])
    assert float((result.vertices - vertices)[4:].norm(dim=1).min()) > 0.01
    assert float(planarity(result.vertices, both).max()) < 1e-4
    assert topology.num_faces == 1
