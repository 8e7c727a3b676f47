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
    """Within the limit none can: after the whole weight they are made planar beyond it, and E is lowered there."""
    shares, planar, settings = [], [], FairSettings(planar="quads", continuation=())
    stage, planar_stage = FairProblem.stage, FairProblem.planar_stage

    def noted(problem: FairProblem, state: State, share: float, *others: Any) -> Stage:
        shares.append(share)
        return stage(problem, state, share, *others)

    def noted_planar(problem: FairProblem, state: State, share: float) -> Stage:
        planar.append(len(shares))
        return planar_stage(problem, state, share)

    monkeypatch.setattr(FairProblem, "stage", noted)
    monkeypatch.setattr(FairProblem, "planar_stage", noted_planar)
    result = minimise_normal_variation(*quad(0.4), settings=settings)
    assert result.holds
    assert planar[0] == 8
    assert shares[:8] == pytest.approx([(number + 1) / 8 for number in range(8)])


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
