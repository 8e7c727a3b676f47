"""Principal quads made planar: within the distance limit, and with edges that keep their directions."""

from __future__ import annotations

import itertools
import sys
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.boundary import boundary_corners
from torchfair.formfinding import (
    PLANAR_QUADS,
    FairSettings,
    JobResult,
    Level,
    Promise,
    minimise_normal_variation,
    planar_quads,
)
from torchfair.formfinding.fair.kept_corners import held_corners
from torchfair.geometry import face_areas
from torchfair.meshing import QuadMesh, combing, measure_mesh_on, principal_quads
from torchfair.projection import Callback, Status
from torchfair.shapes import PrincipalParaboloid, builtin_mesh, icosphere, irregular_triangles

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


def test_edges_are_drawn_to_the_principal_directions_where_they_are():
    """Kept parallel to what they were, edges leave the directions as they move along: where quads are nearly square."""
    ball = icosphere(3)
    surface = ball.vertices * ball.vertices.new_tensor([1.0, 0.75, 0.5]), ball.topology
    mesh = principal_quads(*surface, count=150)
    made, job = planar_quads(mesh, surface)
    kept = minimise_normal_variation(mesh.vertices, mesh.topology, reference=surface, settings=PLANAR_QUADS)
    parallel = measure_mesh_on(kept.vertices, mesh)
    assert job.holds
    assert kept.holds
    before, after = mesh.report["angle_mean_degrees"], made.report["angle_mean_degrees"]
    assert after - before < 0.5 * (parallel["angle_mean_degrees"] - before)
    assert made.report["normal_variation"] < 1.005 * parallel["normal_variation"]


def test_where_edges_turn_too_far_directions_count_more_and_what_is_left_is_said(saddle, asked, monkeypatch):
    surface, mesh = saddle
    once, _ = planar_quads(mesh, surface)
    monkeypatch.setattr(MODULE, "_TURNED", -1.0)  # whatever they turn is too far
    twice, job = planar_quads(mesh, surface)
    assert asked[:2] == [PLANAR_QUADS, PLANAR_QUADS]
    assert asked[2:] == [replace(PLANAR_QUADS, direction_weight=3000.0)]
    assert job.holds
    assert twice.report["planarity_max"] < 1e-4
    assert turned(twice) <= turned(once)
    (note,) = (note for note in twice.notes if "turn edges" in note)
    assert f"{twice.report['angle_mean_degrees']:.2g} now" in note


@pytest.mark.parametrize(
    ("ratio", "turn", "holds", "warp", "follows", "is_better"),
    [
        (1.011, 0.5, True, 1e-5, "_SOFTER", "_has_less_energy"),
        (1.011, -0.3, True, 1e-5, "_SOFTER", "_has_less_energy"),
        (1.009, 0.2, True, 1e-5, None, ""),
        (None, 0.0, True, 0.0, None, ""),  # a flat surface
        (1.011, 0.6, True, 1e-5, None, ""),
        (1.011, 0.2, False, 0.011, None, ""),  # what is far from planar would not become so
        (1.011, 1.1, True, 1e-4, "_STIFFER", "_turns_less"),
        (0.9, 1.1, False, 0.011, "_STIFFER", "_turns_less"),
        (0.9, 1.1, False, 0.1, "_STIFFER", "_turns_less"),
        (0.9, 1.1, False, 0.11, None, ""),
        (0.9, 1.1, False, 0.01, "_LITTLE_SOFTER", "_is_planar"),
        (0.9, 0.7, False, 1.1e-4, "_LITTLE_SOFTER", "_is_planar"),
        (None, 0.0, False, 0.003, "_LITTLE_SOFTER", "_is_planar"),
    ],
)
def test_what_follows_the_first_solve(ratio, turn, holds, warp, follows, is_better):
    report = {
        "variation_over_curvature": ratio,
        "angle_mean_degrees": 1.0 + turn,
        "planarity_max": warp,
        "before_planar": {"angle_mean_degrees": 1.0},
    }
    found = MODULE._again(report, holds=holds, steps=250)
    if is_better != "_is_planar":
        assert MODULE._again(report, holds=holds, steps=251) is None
    if follows is None:
        assert found is None
    else:
        settings, better = found
        assert settings is getattr(MODULE, follows)
        assert better is getattr(MODULE, is_better)


def test_nothing_more_is_tried_where_panels_are_far_from_planar(saddle, asked, monkeypatch):
    surface, mesh = saddle
    for warp, solves in ((0.11, 1), (0.09, 2)):
        asked.clear()
        measured = partial(
            lambda vertices, of, warp: {**measure_mesh_on(vertices, of), "planarity_max": warp}, warp=warp
        )
        monkeypatch.setattr("torchfair.meshing.measure_mesh_on", measured)
        planar_quads(mesh, surface)
        assert asked == solves * [PLANAR_QUADS]


@pytest.mark.parametrize(("second", "taken"), [(9e-5, True), (1.1e-4, False)])
def test_where_panels_are_nearly_planar_directions_count_two_thirds_and_what_is_planar_is_taken(
    saddle, asked, monkeypatch, second, taken
):
    """Though not where it is not, whatever else is better."""
    surface, mesh = saddle
    warps = iter([3e-3, second])
    monkeypatch.setattr(MODULE, "held_corners", lambda topology, corners: [])

    def measured(vertices: Tensor, of: QuadMesh) -> dict[str, Any]:
        return {**measure_mesh_on(vertices, of), "planarity_max": next(warps)}

    monkeypatch.setattr("torchfair.meshing.measure_mesh_on", measured)
    made, _ = planar_quads(mesh, surface)
    assert asked == [MODULE.PLANAR_QUADS, MODULE._LITTLE_SOFTER]
    assert made.report["planarity_max"] == (second if taken else 3e-3)


def test_directions_count_less_where_e_is_above_c(saddle, asked, monkeypatch):
    """And what has less E is taken."""
    surface, mesh = saddle
    once, _ = planar_quads(mesh, surface)
    asked.clear()
    monkeypatch.setattr(MODULE, "_LEAST", 0.0)
    twice, job = planar_quads(mesh, surface)
    assert asked == [PLANAR_QUADS, replace(PLANAR_QUADS, direction_weight=100.0)]
    assert job.holds
    assert twice.report["planarity_max"] < 1e-4
    assert twice.report["normal_variation"] < once.report["normal_variation"]
    assert turned(twice) < 1


@pytest.mark.parametrize(("turn", "energy", "taken"), [(0.9, 0.99, True), (1.1, 0.99, False), (0.2, 1.01, False)])
def test_less_e_is_taken_only_where_edges_turn_no_farther_than_they_may(saddle, monkeypatch, turn, energy, taken):
    surface, mesh = saddle
    solve, solved = MODULE.minimise_normal_variation, []

    def noted(*args: Any, **kwargs: Any) -> JobResult[Level]:
        solved.append(solve(*args, **kwargs))
        return solved[-1]

    def measured(vertices: Tensor, of: QuadMesh) -> dict[str, Any]:
        report = measure_mesh_on(vertices, of)
        second = len(solved) > 1
        angle = mesh.report["angle_mean_degrees"] + (turn if second else 0.1)
        e = energy if second else 1.0
        return {**report, "angle_mean_degrees": angle, "normal_variation": e, "variation_over_curvature": 1.1}

    monkeypatch.setattr(MODULE, "minimise_normal_variation", noted)
    monkeypatch.setattr("torchfair.meshing.measure_mesh_on", measured)
    made, _ = planar_quads(mesh, surface)
    assert len(solved) == 2
    assert torch.equal(made.vertices, solved[taken].vertices)


def test_faces_beyond_the_distance_limit_are_told_with_what_a_mesh_can_be_asked_for(saddle, monkeypatch):
    """The settings of the solve, planar_distance among them, are not those of a mesh."""
    surface, mesh = saddle
    monkeypatch.setattr(MODULE, "PLANAR_QUADS", replace(PLANAR_QUADS, distance_limit=1e-5))
    made, job = planar_quads(mesh, surface)
    for notes in (made.notes, job.notes):
        (note,) = (note for note in notes if "beyond the distance limit" in note)
        assert note.endswith("limit. Ask for more faces, which are more nearly planar before")
        assert not any("planar_distance" in note for note in notes)


def test_what_is_not_kept_names_what_a_mesh_can_be_asked_for(saddle, monkeypatch):
    """In promises and notes, which are the same; the settings of the solve are those of another command."""
    surface, mesh = saddle
    monkeypatch.setattr(MODULE, "PLANAR_QUADS", replace(PLANAR_QUADS, distance_limit=1e-5, planar_distance=0.0))
    made, job = planar_quads(mesh, surface)
    assert not job.holds
    (missed,) = (str(promise) for promise in job.promises if not promise.holds)
    assert missed.startswith("planarity of kept faces")
    assert missed.endswith("ask for more faces, which are more nearly planar before, or make a rough surface smooth "
        "first: torchfair denoise")  # fmt: skip
    assert missed in job.notes
    assert missed in made.notes
    assert not any("fixed" in note for note in made.notes)


def test_how_the_solve_ended_is_said_without_settings_that_a_mesh_does_not_have(saddle, monkeypatch):
    surface, mesh = saddle
    few = replace(PLANAR_QUADS, projection=replace(PLANAR_QUADS.projection, max_iterations=2))
    monkeypatch.setattr(MODULE, "PLANAR_QUADS", few)
    made, job = planar_quads(mesh, surface)
    assert job.projection.status is Status.MAX_ITERATIONS
    assert made.notes[-1].startswith(f"{job.steps} steps towards planar polygons: ended after as many as there may be")
    assert "allow more" not in made.notes[-1]


def test_corners_of_the_boundary_stay(saddle):
    surface, mesh = saddle
    made, job = planar_quads(mesh, surface)
    corners = boundary_corners(mesh.vertices, mesh.topology, PLANAR_QUADS.corner_angle)
    assert int(corners.sum()) == 4
    assert torch.equal(made.vertices[corners], mesh.vertices[corners])
    assert float((made.vertices - mesh.vertices).norm(dim=1).max()) > 1e-3
    assert job.holds
    assert not any("corners" in note for note in made.notes)


def test_corners_stay_in_single_precision_too(saddle):
    (points, topology), _ = saddle
    surface = points.float() + 20.0, topology
    mesh = principal_quads(*surface, count=60)
    made, _ = planar_quads(mesh, surface)
    corners = boundary_corners(mesh.vertices, mesh.topology, PLANAR_QUADS.corner_angle)
    assert int(corners.sum()) == 4
    assert torch.equal(made.vertices[corners], mesh.vertices[corners])


def test_corners_move_where_faces_are_planar_only_then(saddle, monkeypatch):
    """As where nearly all vertices are said to be corners; how far is said."""
    surface, mesh = saddle
    most = torch.arange(len(mesh.vertices) - 3)
    solve, kept = MODULE.minimise_normal_variation, []

    def noted(*args: Any, fixed: Any, **kwargs: Any) -> JobResult[Level]:
        kept.append(list(fixed))
        return solve(*args, fixed=fixed, **kwargs)

    monkeypatch.setattr(MODULE, "minimise_normal_variation", noted)
    monkeypatch.setattr(MODULE, "corners_of_surface", lambda *args: most)
    monkeypatch.setattr(MODULE, "held_corners", lambda *args: most.tolist())
    made, job = planar_quads(mesh, surface)
    assert kept[0] == most.tolist()
    assert kept[-1] == []
    assert job.holds
    away = (made.vertices - mesh.vertices).norm(dim=1)[most] / mesh.report["spacing"]
    (note,) = (note for note in made.notes if "corners of the boundary moved" in note)
    assert note.startswith(f"{int((away > 1e-9).sum())} of {len(most)} corners of the boundary moved, by up to ")
    assert note.endswith(f"by up to {float(away.max()):.2g} mean edge lengths")


@pytest.mark.parametrize(("second", "moves"), [(9e-5, True), (1.1e-4, False)])
def test_corners_do_not_move_for_panels_that_are_not_planar_then(saddle, asked, monkeypatch, second, moves):
    """Though less warped than with corners in their places."""
    surface, mesh = saddle
    warps = iter([0.05, second, second])

    def measured(vertices: Tensor, of: QuadMesh) -> dict[str, Any]:
        return {**measure_mesh_on(vertices, of), "planarity_max": next(warps)}

    monkeypatch.setattr("torchfair.meshing.measure_mesh_on", measured)
    made, _ = planar_quads(mesh, surface)
    assert made.report["planarity_max"] == (second if moves else 0.05)


def test_a_corner_is_not_held_where_a_face_has_three() -> None:
    """Of a row of three quads."""
    topology = Topology.from_faces([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]])
    assert held_corners(topology, torch.tensor([0, 4, 1])) == []
    assert held_corners(topology, torch.tensor([0, 4])) == [0, 4]
    assert held_corners(topology, torch.tensor([0, 4, 2, 3, 7])) == [0, 4]
    assert held_corners(topology, torch.zeros(0, dtype=torch.long)) == []


def test_small_faces_do_not_become_slivers():
    """Of a mesh with faces of a tenth of the mean area, one fell to half of that."""
    surface = graph_over_a_square(300, monkey=True)
    mesh = principal_quads(*surface, count=60)
    own = face_areas(mesh.vertices, mesh.topology)
    for share in (0.05, 0.3):
        settings = replace(PLANAR_QUADS, smallest_share=share)
        job = minimise_normal_variation(mesh.vertices, mesh.topology, reference=surface, settings=settings)
        now = face_areas(job.vertices, mesh.topology)
        assert bool((now >= (0.9 * own).clamp_max(share * float(own.mean()))).all())
        (promise,) = (promise for promise in job.promises if promise.name == "smallest area over the mean")
        assert promise.holds
        assert promise.asked == pytest.approx(min(share, 0.9 * float(own.min() / own.mean())))
        assert promise.reached == pytest.approx(float(now.min() / own.mean()))
    without = minimise_normal_variation(
        mesh.vertices, mesh.topology, reference=surface, settings=replace(PLANAR_QUADS, smallest_share=0.0)
    )
    assert float(without.after["smallest_area_share"]) < 0.06
    assert not any(promise.name == "smallest area over the mean" for promise in without.promises)


def test_a_solve_that_is_stopped_is_not_followed_by_another(saddle, asked, monkeypatch):
    surface, mesh = saddle
    monkeypatch.setattr(MODULE, "_TURNED", -90.0)
    planar_quads(mesh, surface, callback=lambda record: True)
    assert len(asked) == 1


def stops_the_second_solve(asked: list[FairSettings]) -> Callback:
    return lambda record: len(asked) > 1 or None


def raises_in_the_second_solve(asked: list[FairSettings]) -> Callback:
    def interrupt(record: object) -> None:
        if len(asked) > 1:
            raise KeyboardInterrupt

    return interrupt


@pytest.mark.parametrize(
    ("ending", "status"),
    [(stops_the_second_solve, Status.CALLBACK), (raises_in_the_second_solve, Status.INTERRUPTED)],
)
def test_who_stops_the_second_solve_gets_the_first_and_is_told_that_it_was_stopped(
    saddle, asked, monkeypatch, ending, status
):
    surface, mesh = saddle
    once, _ = planar_quads(mesh, surface)
    asked.clear()
    monkeypatch.setattr(MODULE, "_TURNED", -90.0)
    made, job = planar_quads(mesh, surface, callback=ending(asked))
    assert len(asked) == 2
    assert torch.equal(made.vertices, once.vertices)
    assert job.holds
    assert job.stopped
    assert job.projection.status is status
    assert job.message in made.notes[-1]


@pytest.mark.parametrize(
    ("measure", "before", "first", "second", "taken"),
    [
        ("largest_planarity", 0.0, 2e-4, 3e-4, False),
        ("largest_planarity", 0.0, 3e-4, 2e-4, True),
        ("largest_planarity", 1.0, 2e-4, 3e-4, False),
        ("largest_distance_relative", 0.0, 0.05, 0.06, False),
        ("largest_distance_relative", 0.0, 0.01, 0.03, True),
        ("largest_distance_relative", 0.06, 0.05, 0.06, True),
        ("largest_distance_relative", 0.06, 0.05, 0.07, False),
    ],
)
def test_what_turns_less_is_taken_only_where_it_is_as_planar_and_as_near(
    saddle, monkeypatch, measure, before, first, second, taken
):
    """Where neither solve keeps its promises, too; as near as the mesh was before is near enough."""
    surface, mesh = saddle
    solve, solved, reports = MODULE.minimise_normal_variation, [], []

    def broken(*args: Any, **kwargs: Any) -> JobResult[Level]:
        job = solve(*args, **kwargs)
        level = job.levels[-1]
        start, after = {**level.before, measure: before}, {**level.after, measure: second if solved else first}
        solved.append(job)
        missed = [Promise("nothing", 0.0, 1.0)]
        return replace(job, levels=[replace(level, before=start, after=after, promises=missed)])

    def turn(report: dict[str, Any]) -> float:
        """Less of the second."""
        if not any(known is report for known in reports):
            reports.append(report)
        return 3.0 if report is reports[0] else 2.0

    monkeypatch.setattr(MODULE, "minimise_normal_variation", broken)
    monkeypatch.setattr(MODULE, "_turn", turn)
    made, _ = planar_quads(mesh, surface)
    assert torch.equal(made.vertices, solved[taken].vertices)


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
def test_planar_faces_that_cost_a_little_of_e_stay_within_the_distance_limit(monkeypatch):
    """A monkey saddle: faces went up to half an edge away, where E was lower.

    Its mesh is the one on which they did, whose singular point lies at a vertex of too few triangles: elsewhere
    planarity costs more E.
    """
    monkeypatch.setattr(combing, "with_room", lambda frames, angles, matched, *rest: (angles, matched))
    surface = graph_over_a_square(500, monkey=True)
    mesh = principal_quads(*surface, count=150)
    made, job = planar_quads(mesh, surface)
    assert job.holds
    assert made.report["planarity_max"] < 1e-4
    assert job.after["largest_distance_relative"] <= 0.03 * (1 + 1e-6)
    assert not any("beyond the distance limit" in note for note in made.notes)
    assert made.report["normal_variation"] < 1.02 * mesh.report["normal_variation"]
    assert turned(made) < 1


def box(cells: int) -> tuple[Tensor, Topology]:
    """The unit cube, of squares."""
    places: dict[tuple[int, ...], int] = {}
    faces = []
    for axis, level, i, j in itertools.product(range(3), (0, cells), range(cells), range(cells)):
        square = [(level, i + a, j + b) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        corners = [tuple(of[(k - axis) % 3] for k in range(3)) for of in square]
        face = [places.setdefault(corner, len(places)) for corner in corners]
        faces.append(face if level else face[::-1])
    return torch.tensor(list(places), dtype=torch.float64) / cells, Topology.from_faces(faces)


def test_planar_faces_with_the_least_e_stay_where_they_are():
    """Smoothed absolute values and fairness have a minimum with a little more E, off the surface."""
    vertices, topology = box(2)
    job = minimise_normal_variation(vertices, topology, reference=(vertices, topology), settings=PLANAR_QUADS)
    assert torch.equal(job.vertices, vertices)
    assert job.after["normal_variation"] == job.before["normal_variation"]
    assert job.holds


def test_planar_faces_do_not_stay_where_vertices_are_pulled():
    """Along an edge of the cube, which costs hardly any E."""
    vertices, topology = box(2)
    (middle,) = (vertices == torch.tensor([0.0, 0.0, 0.5])).all(1).nonzero().flatten().tolist()
    job = minimise_normal_variation(
        vertices, topology, reference=(vertices, topology), settings=PLANAR_QUADS, handles={middle: [0.0, 0.0, 0.51]}
    )
    assert job.after["normal_variation"] < 1.02 * job.before["normal_variation"]
    assert job.after["largest_handle_distance"] < 0.005
