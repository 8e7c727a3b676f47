"""Lengths that follow the field, and singular points that are not rounded to one place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meshing_tools import Flat, cut, ellipsoid, irregular, problem_of

from torchfair import MeshError
from torchfair.fields import FaceFrames, matchings
from torchfair.fields.frames import Floats
from torchfair.meshing import MeshingSettings, prepared, sound_map
from torchfair.meshing.components import read_surface
from torchfair.meshing.cut_graph import CutGraph, cut_open
from torchfair.meshing.failed_attempt import FailedAttemptError
from torchfair.meshing.ladder import Again, mesh_component
from torchfair.meshing.lattice import SQUARES, Lattice, triangle_lattice
from torchfair.meshing.no_mesh import NoMeshError
from torchfair.meshing.plan import Plan
from torchfair.meshing.plans import plans
from torchfair.meshing.relaxation import loosened, stretched
from torchfair.meshing.seamless_map import MapProblem, SeamlessMap
from torchfair.meshing.separation import gaps, separate_vectors
from torchfair.shapes import PrincipalParaboloid, Torus


def off_the_field(jacobians: Floats) -> float:
    """Mean angle of both gradients to the directions."""
    a, b, c, d = jacobians
    return float((np.abs(np.arctan2(b, a)) + np.abs(np.arctan2(c, d))).mean())


def fan() -> tuple[FaceFrames, CutGraph]:
    """A square in the plane with lines away from a point outside, and circles around it."""
    frames = FaceFrames.of(*irregular(Flat(), 500))
    away = frames.centres - np.array([2.0, 0, 0])
    angles = np.arctan2((away * frames.second).sum(1), (away * frames.first).sum(1))
    return frames, cut_open(frames, angles, matchings(frames, angles), np.zeros(len(frames.points), np.int64))


def test_lines_that_diverge_keep_their_directions_where_lengths_may_follow() -> None:
    frames, graph = fan()
    problem = problem_of(frames, graph, 0.3)[0]
    after = stretched(problem)
    assert off_the_field(after.real_jacobians) < 0.85 * off_the_field(problem.real_jacobians)
    radii = np.linalg.norm(frames.centres - np.array([2.0, 0, 0]), axis=1)
    circles = np.log(after.density[:, 1] * 0.3)
    assert np.corrcoef(circles, -np.log(radii))[0, 1] > 0.9  # as many lines on every circle
    assert -1.1 < np.polyfit(np.log(radii), circles, 1)[0] < -0.5
    twice = stretched(replace(problem, density=2 * problem.density))
    assert np.allclose(twice.density, 2 * after.density, rtol=1e-8)  # in proportion to what is wanted


def test_directions_weigh_less_only_around_triangles_that_are_turned_over() -> None:
    frames, graph = fan()
    sound = problem_of(frames, graph, 0.3)[0]
    assert loosened(sound, sound.density) is sound
    distance = np.linalg.norm(frames.centres, axis=1)
    signs = np.where((distance < 0.2)[:, None], [-1.0, 1.0], 1.0)
    weights = loosened(replace(sound, density=signs * sound.density), sound.density).anisotropy
    assert (weights[distance < 0.2] == 6).all()  # once: then densities are those that come out
    assert (weights[distance > 0.8] == 30).all()


def test_gaps_are_whole_whatever_cuts_lie_between() -> None:
    frames, graph = cut(*ellipsoid(3))
    problem = problem_of(frames, graph, 0.15)[0]
    found = problem.candidates()[0]
    between = gaps(frames, graph, problem.seams, 10.0) @ found.values
    assert len(between) == 8 * 7 / 2
    assert np.allclose(between, np.rint(between.real) + 1j * np.rint(between.imag), atol=1e-8)
    assert (np.abs(between) > 0.5).all()
    assert gaps(frames, graph, problem.seams, 0.3).shape[0] < len(between)


def test_nodes_are_kept_apart_whether_they_are_singular_or_not() -> None:
    frames, graph = cut(*ellipsoid(3))
    singular = np.flatnonzero(graph.charges)
    near = np.linalg.norm(frames.points - frames.points[singular[0]], axis=1)
    graph.nodes[np.argsort(near)[3]] = True  # such as the end of a crease
    problem = problem_of(frames, graph, 0.3)[0]
    between = gaps(frames, graph, problem.seams, 10.0)
    assert between.shape[0] == 9 * 8 / 2
    for found in problem.candidates():
        assert (np.abs(between @ found.values) > 0.5).all()


def test_vectors_that_let_singular_points_coincide_are_avoided() -> None:
    metric, target = np.diag([1.0, 0.9, 0.8]), np.array([0.3, -0.1, 2.1])
    rows = np.array([[1.0, 0, 0], [0, 1, 0]])
    vectors = separate_vectors(metric, target, rows, np.zeros(2))
    assert vectors[0].tolist() == [1, 0, 2]
    assert (vectors[:, :2] != 0).any(1).all()
    assert separate_vectors(metric, target, rows[:0], np.zeros(0))[0].tolist() == [0, 0, 2]
    assert separate_vectors(metric, target, rows, np.array([0.0, 1.0]))[0].tolist() == [0, 0, 2]


def test_a_search_can_begin_with_a_later_plan() -> None:
    surface = read_surface(*irregular(PrincipalParaboloid(), 600), MeshingSettings())
    given = surface.parts[0], surface.fields[0], SQUARES, 0.3, 0.25, MeshingSettings()
    _, words, plan = mesh_component(*given)
    assert (words, plan) == ("", 0)
    _, words, plan = mesh_component(*given, Again(1, 0.3))
    assert (words, plan) == ("boundary not aligned", 1)


@pytest.mark.parametrize("sound_at", [1, 2, 3])
def test_a_map_that_is_turned_over_is_made_anew_once_where_weights_can_be_looser(
    sound_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first map that is sound is taken; a second one is made only of a looser problem, and no third."""
    untangle, weights = sound_map._untangled, list[Floats]()

    def turned_over(problem: MapProblem) -> SeamlessMap:
        weights.append(problem.anisotropy)
        found = untangle(problem)
        return found if len(weights) >= sound_at else replace(found, areas=np.r_[-1.0, found.areas[1:]])

    def looser(problem: MapProblem, wanted: Floats) -> MapProblem:
        assert (wanted == wanted.flat[0]).all()  # not those that the field allows
        return replace(problem, anisotropy=problem.anisotropy / 5)

    monkeypatch.setattr(sound_map, "_untangled", turned_over)
    monkeypatch.setattr(sound_map, "loosened", looser)
    surface = read_surface(*irregular(PrincipalParaboloid(), 600), MeshingSettings())
    given = surface.parts[0], surface.fields[0], SQUARES, 0.3, 0.1, MeshingSettings(fallback=False)
    if sound_at > 2:
        with pytest.raises(NoMeshError, match="near vertex"):
            mesh_component(*given)
    else:
        mesh, words, _ = mesh_component(*given)
        assert len(mesh.faces) > 10
        assert words == ""
    assert [tuple(np.unique(each)) for each in weights] == [(30.0,), (6.0,)][:sound_at]


@pytest.mark.parametrize("lattice", [SQUARES, triangle_lattice(1.0)])
def test_where_there_is_no_boundary_nothing_is_tried_with_and_without_aligning_to_it(
    lattice: Lattice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both are the same mesh, as of a torus here."""
    surface = read_surface(*irregular(Torus(), 600), MeshingSettings())
    given = surface.parts[0], surface.fields[0], lattice, 0.5, 0.25
    meshes = [mesh_component(*given, MeshingSettings(align_boundary=align))[0] for align in (True, False)]
    assert len({(len(mesh.faces), mesh.positions.tobytes()) for mesh in meshes}) == 1
    for bounded, aligned in ((False, {False}), (True, {False, True})):
        rungs = list(plans(0.5, 0.25, MeshingSettings(), rows=lattice.has_rows, bounded=bounded))
        assert {rung.plan.align for rung in rungs} == aligned
        assert any("boundary" in rung.words for rung in rungs) == bounded
    tried: list[bool] = []

    def fails(*given: Any) -> None:
        tried.append(given[4].align)
        raise FailedAttemptError("no")

    monkeypatch.setattr(prepared, "attempt", fails)
    with pytest.raises(NoMeshError):
        mesh_component(*given, MeshingSettings())
    assert set(tried) == {False}
    creased = list(plans(0.5, 0.25, MeshingSettings(), creased=True, bounded=False))
    assert {(rung.plan.creases, rung.plan.align) for rung in creased} == {(True, True), (True, False), (False, False)}


def test_with_another_spacing_only_plans_of_the_same_size_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Plan] = []

    def fails(*given: Any) -> None:
        tried.append(given[4])
        raise FailedAttemptError("no", hopeless=len(tried) == 1)

    monkeypatch.setattr(prepared, "attempt", fails)
    surface = read_surface(*irregular(PrincipalParaboloid(), 600), MeshingSettings())
    given = surface.parts[0], surface.fields[0], SQUARES, 0.5, 0.25, MeshingSettings()
    with pytest.raises(NoMeshError, match="5 setting"):
        mesh_component(*given, Again(3, 0.5))
    assert {plan.spacing for plan in tried} == {surface.parts[0].pose.length(0.5)}
    tried.clear()
    with pytest.raises(NoMeshError):
        mesh_component(*given)
    kinds = [(plan.smoothing, plan.align) for plan in tried]
    assert kinds.count(kinds[0]) == 1  # hopeless: not tried with other spacings
    assert kinds.count(kinds[1]) == 5
    tried.clear()
    with pytest.raises(NoMeshError, match="one setting"):
        mesh_component(*given, Again(3, 0.5, others=False))
    assert len(tried) == 1


def test_fields_that_cannot_be_made_even_are_tried_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """With another spacing they cannot, either."""
    tried: list[float] = []

    def fails(*_given: Any, even: float) -> None:
        tried.append(even)
        raise MeshError("no")

    monkeypatch.setattr(prepared, "combed", fails)
    surface = read_surface(*irregular(PrincipalParaboloid(), 600), MeshingSettings())
    with pytest.raises(NoMeshError):
        mesh_component(surface.parts[0], surface.fields[0], triangle_lattice(0.9), 0.5, 0.25, MeshingSettings())
    assert sorted(tried) == 8 * [0.0] + [0.3, 0.3, 3.0, 3.0, 10.0, 10.0]  # aligned with the boundary and not


def test_steps_go_the_way_in_which_they_are_apart() -> None:
    rows = np.array([[1.0, 0, 0], [0, 1, 0]])
    vectors = separate_vectors(np.diag([1.0, 0.9, 0.8]), np.array([-0.3, 0.1, 2.1]), rows, np.zeros(2))
    assert vectors[0].tolist() == [-1, 0, 2]
