"""What the job that lowers E promises beyond E: panels, sizes, flips, the boundary, and which surface is meant."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, split_quads
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.formfinding import FairRecipe, FairSettings, Promise, Session, minimise_normal_variation
from torchfair.formfinding.fair.panel_sizes import growth_terms, own_sizes
from torchfair.formfinding.fair.planar_faces import NearlyPlanar
from torchfair.geometry import face_areas, face_normals
from torchfair.geometry.planarity import planarity

QUICK = FairSettings(continuation=(), flat="none")
ANYWHERE = FairSettings(reference_distance=math.inf)


def sheet(n: int = 7, *, triangles: bool = True) -> tuple[Tensor, Topology]:
    """A saddle over a grid of unit steps."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE) - (n - 1) / 2,) * 2, indexing="ij")
    vertices = torch.stack([x, y, 0.1 * x**2 - 0.05 * y**2], -1).reshape(-1, 3)
    faces = grid_faces(n, n)
    return vertices, Topology.from_faces(split_quads(faces) if triangles else faces)


def warped(by: float, n: int = 7) -> tuple[Tensor, Topology]:
    """A translational surface, whose quads are planar, with heights that alternate: planarity ``by``, or less."""
    vertices, topology = sheet(n, triangles=False)
    signs = 1.0 - 2.0 * (torch.arange(n)[:, None] + torch.arange(n)[None]).remainder(2).to(DOUBLE).reshape(-1)
    vertices[:, 2] += 0.5 * by * signs
    return vertices, topology


def test_nearly_planar_faces_do_not_become_less_planar() -> None:
    vertices, topology = warped(2e-3)
    had = planarity(vertices, topology)
    assert 1e-3 < float(had.max()) < 5e-3
    kept, let_go = (
        minimise_normal_variation(vertices, topology, settings=FairSettings(planar=planar))  # type: ignore[arg-type]
        for planar in ("keep", "none")
    )
    assert float((planarity(kept.vertices, topology) - had.clamp_min(1e-4)).max()) < 1e-5
    assert kept.holds
    assert kept.after["normal_variation"] < 0.99 * kept.before["normal_variation"]
    assert any("nearly planar faces" in note and "do not become" in note for note in kept.notes)
    assert float(planarity(let_go.vertices, topology).max()) > 5e-3  # what it is there for
    assert any("are let go" in note for note in let_go.notes)
    assert let_go.after["largest_planarity_of_all"] == pytest.approx(float(planarity(let_go.vertices, topology).max()))


def test_nearly_planar_faces_cost_what_is_beyond_what_they_had() -> None:
    vertices, topology = warped(2e-3)
    nearly = NearlyPlanar.of(vertices, topology, FairSettings(), torch.zeros(0, dtype=torch.int64))
    (term,) = nearly.terms(topology, weight=1.0)
    for factor, beyond in ((0.9, 0.0), (1.0, 0.02), (3.0, 2.02)):
        other = vertices.clone()
        other[:, 2] = warped(0.0)[0][:, 2] + factor * (vertices - warped(0.0)[0])[:, 2]
        values = term.values(term.arguments({"vertices": other})).reshape(-1).abs()
        mean = planarity(other, topology) / planarity(vertices, topology)  # in their own mean edges, about 1
        expected = beyond * nearly.most * torch.ones_like(mean)[nearly.faces]
        torch.testing.assert_close(values, expected, rtol=0.1, atol=1e-6)


@pytest.mark.slow
def test_handles_turn_no_face_over_or_say_so() -> None:
    """Pulled sideways over its neighbours, and far up."""
    vertices, topology = sheet()
    normals = face_normals(vertices, topology)
    for target in ((3.4, 0.0, 1.5), (0.0, 0.0, 4.0)):
        result = minimise_normal_variation(vertices, topology, handles={24: target})
        turned = (face_normals(result.vertices, topology) * normals).sum(1) <= 0.0
        assert not turned.any()
        assert any(promise.name == "faces turned over" and promise.holds for promise in result.promises)
        away = float((result.vertices[24] - torch.tensor(target, dtype=DOUBLE)).norm())
        if away > 0.05 * result.before["mean_edge_length"]:
            assert not result.holds


def test_faces_may_turn_over_where_that_is_asked_for() -> None:
    vertices, topology = sheet()
    normals, target = face_normals(vertices, topology), (3.4, 0.0, 1.5)
    settings = FairSettings(faces_may_turn=True)
    result = minimise_normal_variation(vertices, topology, handles={24: target}, settings=settings)
    assert ((face_normals(result.vertices, topology) * normals).sum(1) <= 0.0).any()
    assert not any(promise.name == "faces turned over" for promise in result.promises)


def test_a_free_boundary_does_not_shrink() -> None:
    vertices, topology = sheet()
    area = float(face_areas(vertices, topology).sum())
    held, loose = (
        minimise_normal_variation(
            vertices, topology, settings=FairSettings(boundary="free", flat="none", free_boundary_weight=weight)
        )
        for weight in (30.0, 0.0)
    )
    assert float(face_areas(held.vertices, topology).sum()) > 0.97 * area
    assert held.holds
    assert float(face_areas(loose.vertices, topology).sum()) < 0.8 * area
    (shrunk,) = (promise for promise in loose.promises if promise.name == "area")
    assert not shrunk.holds
    rim = topology.is_boundary_vertex
    assert float((held.vertices - vertices)[rim].norm(dim=1).max()) > 1e-3  # free all the same


@pytest.mark.parametrize(("factor", "words"), [(1000.0, "divide it by 1000"), (1 / 25.4, "multiply it by 25.4")])
def test_a_reference_in_another_unit_is_refused(factor: float, words: str) -> None:
    vertices, topology = sheet(9)
    with pytest.raises(MeshError, match=words):
        FairRecipe(vertices, topology, reference=(factor * vertices, topology))
    FairRecipe(vertices, topology, reference=(factor * vertices, topology), settings=ANYWHERE)


def test_a_mesh_may_be_part_of_a_larger_reference() -> None:
    """Also one that is ten times as large, where the shape is another."""
    (large, whole), (vertices, topology) = sheet(31), sheet(4)
    part = torch.cat([vertices[:, :2], (0.1 * vertices[:, 0] ** 2 - 0.05 * vertices[:, 1] ** 2)[:, None]], 1)
    FairRecipe(part, topology, reference=(large, whole))


def test_how_far_a_reference_may_be_can_be_set() -> None:
    vertices, topology = sheet()
    for scale in (1e-3, 1.0, 1e3):  # in mean edges
        beside = scale * (vertices + torch.tensor([0.0, 0.0, 5.0], dtype=DOUBLE))
        with pytest.raises(MeshError, match=r"4\.\d+ of its mean edges away") as error:
            FairRecipe(scale * vertices, topology, reference=(beside, topology))
        assert "unit:" not in str(error.value)
        FairRecipe(
            scale * vertices, topology, reference=(beside, topology), settings=FairSettings(reference_distance=6)
        )


def test_fixed_vertices_stay_on_every_level() -> None:
    vertices, topology = sheet()
    free = minimise_normal_variation(vertices, topology, settings=QUICK)
    moved = (free.vertices - vertices).norm(dim=1)
    chosen = torch.topk(moved, 3).indices.tolist()
    assert float(moved[chosen].min()) > 1e-2
    for levels in (0, 1):
        result = minimise_normal_variation(vertices, topology, fixed=chosen, levels=levels, settings=QUICK)
        assert torch.equal(result.vertices[chosen], vertices[chosen])
        assert any("3 vertices are fixed" in note for note in result.notes)
    with pytest.raises(MeshError, match="numbered 0 to 48"):
        FairRecipe(vertices, topology, fixed=[49])
    with pytest.raises(MeshError, match="at once"):
        FairRecipe(vertices, topology, fixed=[24], handles={24: (0.0, 0.0, 1.0)})
    session = Session(FairRecipe(vertices, topology, fixed=[24]))
    session.move({24: (0.0, 0.0, 0.5)})  # later it may be pulled
    assert session.step().accepted


@pytest.mark.parametrize("largest", [1.2, 1.6])
def test_no_face_grows_beyond_its_bound(largest: float) -> None:
    vertices, topology = sheet()
    before = face_areas(vertices, topology)
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(largest_area=largest, flat="none"))
    growth = face_areas(result.vertices, topology) / before.clamp_min(0.5 * float(before.mean()))
    assert float(growth.max()) <= largest * (1 + 1e-9)
    assert result.holds
    assert result.after["largest_growth"] == pytest.approx(float(growth.max()))
    assert result.after["largest_face_area"] == pytest.approx(float(face_areas(result.vertices, topology).max()))
    assert result.after["normal_variation"] < result.before["normal_variation"]


def test_small_faces_may_grow_to_what_faces_are() -> None:
    vertices, topology = sheet(4)
    areas = face_areas(vertices, topology)
    assert torch.equal(own_sizes(vertices, topology), areas.clamp_min(0.5 * float(areas.mean())))


def test_the_barrier_of_sizes_has_its_derivatives() -> None:
    vertices, topology = sheet(4, triangles=False)
    areas = face_areas(vertices, topology)
    (term,) = growth_terms(topology, 1.02 * areas, weight=1.0)
    corners = vertices[term.stencil[0][1]]
    most = term.data[0]
    expected = torch.func.vmap(torch.func.jacrev(lambda x, m: term.residual(x[None], m[None])[0]))(corners, most)
    assert term.jacobian is not None
    torch.testing.assert_close(term.jacobian(corners, most), expected.reshape(len(most), -1))
    assert bool((term.residual(corners, most) > 0.0).all())
    assert bool((term.residual(corners, 2.0 * areas) == 0.0).all())
    assert bool(torch.isinf(term.residual(corners, 0.99 * areas)).all())


def test_what_is_cut_off_is_said() -> None:
    """Without creases a coarse cube loses its corners, though no vertex of the result is far from it."""
    vertices, quads = cube()
    topology = Topology.from_faces(split_quads(quads.corners.view(-1, 4).numpy()))
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(crease_angle=0.0, distance_back=0.3))
    assert result.after["largest_distance_relative"] < 0.05
    assert result.after["largest_distance_back_relative"] > 0.3
    (back,) = (promise for promise in result.promises if promise.name == "distance of the input from the result")
    assert not back.holds


def test_words_tell_what_was_asked_for_from_what_the_start_had() -> None:
    asked = Promise("distance", 0.07, 0.06, unit="edges", of_settings=0.05)
    assert str(asked) == "distance 0.06 edges, at most 0.07 as at the start (0.05 asked for)"
    assert str(Promise("distance", 0.05, 0.06, of_settings=0.05, where="here", remedy="do")) == (
        "distance 0.06, at most 0.05 asked for: NOT REACHED; here; do"
    )
    assert asked.as_dict()["of_settings"] == 0.05


@pytest.mark.slow
def test_finer_levels_say_the_limit_that_was_asked_for() -> None:
    vertices, topology = sheet(5)
    bent = vertices * torch.tensor([1.0, 1.0, 5.0], dtype=DOUBLE)
    settings = FairSettings(distance_limit=1e-3, crease_angle=0.0)
    result = minimise_normal_variation(bent, topology, levels=1, settings=settings)
    (promise,) = (promise for promise in result.promises if promise.name == "distance from the reference")
    assert promise.of_settings == 1e-3
    assert "(0.001 asked for)" in str(promise)
    assert math.isclose(promise.asked, result.levels[1].before["largest_distance_relative"])
