"""Principal quads made planar: within the distance limit, and with edges that keep their directions."""

from __future__ import annotations

import sys
from typing import Any

import pytest
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import PLANAR_QUADS, FairSettings, JobResult, Level, planar_quads
from torchfair.meshing import QuadMesh, principal_quads
from torchfair.shapes import PrincipalParaboloid, builtin_mesh, irregular_triangles

MODULE = sys.modules[planar_quads.__module__]


def graph_over_a_square(vertices: int, *, monkey: bool) -> tuple[Tensor, Topology]:
    """A monkey saddle or an ordinary one."""
    made = irregular_triangles(PrincipalParaboloid(1.0, -0.5), vertices)
    x, y = made.vertices.T[:2]
    return (torch.stack([x, y, x**3 - 3 * x * y**2], 1) if monkey else made.vertices), made.topology


@pytest.fixture(scope="module")
def saddle() -> tuple[tuple[Tensor, Topology], QuadMesh]:
    surface = graph_over_a_square(300, monkey=False)
    return surface, principal_quads(*surface, count=60)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[FairSettings]:
    """Settings of the solves, one after the other."""
    found: list[FairSettings] = []
    solve = MODULE.minimise_normal_variation

    def noted(*args: Any, settings: FairSettings, **kwargs: Any) -> JobResult[Level]:
        found.append(settings)
        return solve(*args, settings=settings, **kwargs)

    monkeypatch.setattr(MODULE, "minimise_normal_variation", noted)
    return found


def turned(mesh: QuadMesh) -> float:
    before, after = mesh.report["before_planar"]["angle_mean_degrees"], mesh.report["angle_mean_degrees"]
    return float(after - before)


def test_one_solve_where_edges_keep_their_directions(saddle, asked):
    surface, mesh = saddle
    made, job = planar_quads(mesh, surface)
    assert asked == [PLANAR_QUADS]
    assert job.holds
    assert made.report["planarity_max"] < 1e-4
    assert turned(made) < 1
    assert not any("turn edges" in note for note in made.notes)


def test_where_edges_turn_too_far_e_counts_less_and_what_is_left_is_said(saddle, asked, monkeypatch):
    surface, mesh = saddle
    once, _ = planar_quads(mesh, surface)
    monkeypatch.setattr(MODULE, "_TURNED", -1.0)  # whatever they turn is too far
    twice, job = planar_quads(mesh, surface)
    assert [of.energy_weight for of in asked] == [10, 10, 1]
    assert job.holds
    assert twice.report["planarity_max"] < 1e-4
    assert turned(twice) <= turned(once)
    (note,) = (note for note in twice.notes if "turn edges" in note)
    assert f"{twice.report['angle_mean_degrees']:.2g} now" in note


def test_a_solve_that_is_stopped_is_not_followed_by_another(saddle, asked, monkeypatch):
    surface, mesh = saddle
    monkeypatch.setattr(MODULE, "_TURNED", -90.0)
    planar_quads(mesh, surface, callback=lambda record: True)
    assert len(asked) == 1


def test_panels_at_the_boundary_do_not_grow_to_save_e():
    """Where edges carry no E they grew threefold, and their middles went half an edge off the surface."""
    surface = builtin_mesh("inner_torus")
    mesh = principal_quads(*surface, count=200)
    made, job = planar_quads(mesh, surface)
    assert job.holds
    assert made.report["planarity_max"] < 1e-4
    assert job.after["largest_growth"] <= 1.5
    assert made.report["distance_max"] < 0.15


@pytest.mark.slow
def test_planar_faces_that_cost_a_little_of_e_stay_within_the_distance_limit():
    """A monkey saddle: faces went up to half an edge away, where E was lower."""
    surface = graph_over_a_square(500, monkey=True)
    mesh = principal_quads(*surface, count=150)
    made, job = planar_quads(mesh, surface)
    assert job.holds
    assert made.report["planarity_max"] < 1e-4
    assert job.after["largest_distance_relative"] <= 0.03 * (1 + 1e-6)
    assert not any("beyond the distance limit" in note for note in made.notes)
    assert made.report["normal_variation"] < 1.02 * mesh.report["normal_variation"]
    assert turned(made) < 1
