"""The reflection score: closed forms, convergence, invariance, ranking, and meshes of which nothing is seen."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
import torch
from geometry_meshes import torus
from helpers import DOUBLE, cube, random_rotation, wavy_grid

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.geometry import face_areas
from torchfair.rasterisation import visible_triangles
from torchfair.reflection import (
    OrthographicCamera,
    PerspectiveCamera,
    ReflectionScore,
    ReflectionSetup,
    SmoothReference,
    axis_directions,
    default_camera,
    edge_visibility,
    reflection_score,
    reflection_variation,
)
from torchfair.shapes import (
    Catenoid,
    PrincipalParaboloid,
    Sphere,
    irregular_triangles,
    principal_quads,
    principal_triangles,
    rotated_lattice,
)
from torchfair.triangulation import triangulate

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))
SMALL = {"size": 96, "supersampling": 2}
NUMBERS = ("score", "reflection_variation", "rms", "wobble")


def numbers(result: ReflectionScore) -> torch.Tensor:
    return torch.stack([getattr(result, name) for name in NUMBERS]).to(DOUBLE)


def plate(tilt: float = 0.0, cells: int = 2) -> tuple[torch.Tensor, Topology]:
    """A square from -1 to 1 of flat quads, turned about the x-axis."""
    steps = torch.linspace(-1, 1, cells + 1, dtype=DOUBLE)
    y, x = torch.meshgrid(steps, steps, indexing="ij")
    points = torch.stack([x, y * math.cos(tilt), y * math.sin(tilt)], dim=-1).view(-1, 3)
    index = torch.arange((cells + 1) ** 2).view(cells + 1, -1)
    corners = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
    return points, Topology.from_faces(torch.stack(corners, dim=-1).view(-1, 4))


@pytest.fixture(scope="module")
def setup() -> ReflectionSetup:
    return ReflectionSetup.for_reference(SADDLE, **SMALL)


# ---- what it says --------------------------------------------------------------------------------------


def test_a_plane_mirror_is_smooth_and_like_any_other_cut_of_it():
    result = reflection_score(*plate(), **SMALL)
    assert not numbers(result).any()
    assert (result.compared > 0.1).all()
    finer = reflection_score(*plate(cells=5), plate(), **SMALL)
    torch.testing.assert_close(numbers(finer), torch.zeros(4, dtype=DOUBLE), atol=1e-7, rtol=0)


@pytest.mark.parametrize("tilt", [0.02, 0.3])
def test_error_of_a_tilted_plane_is_twice_the_sine_of_its_tilt_times_that_of_the_view(tilt):
    """Rms and wobble have closed forms where the error is constant."""
    directions = torch.tensor([[0.0, 0, -1], [0.6, 0, -0.8]], dtype=DOUBLE)
    camera = OrthographicCamera(directions, half_widths=1.2)
    result = reflection_score(*plate(tilt), plate(), camera=camera, frequency=1.0, **SMALL)
    jumps = 2 * math.sin(tilt) * torch.linalg.cross(directions, directions.new_tensor([[1.0, 0, 0]])).norm(dim=-1)
    weights = result.window.sum((-2, -1)).to(DOUBLE)
    expected = ((jumps**2 * weights).sum() / weights.sum()).sqrt()
    torch.testing.assert_close(result.rms, expected, rtol=1e-9, atol=0)
    torch.testing.assert_close(result.wobble, expected, rtol=1e-9, atol=0)
    assert result.reflection_variation < 1e-15


def test_finer_meshes_of_a_surface_score_better_and_their_errors_fall_with_first_order(setup):
    results = [
        reflection_score(m.vertices, m.topology, setup) for m in (principal_quads(SADDLE, n, n) for n in (6, 12, 24))
    ]
    for coarse, fine in itertools.pairwise(results):
        assert fine.score < 0.8 * coarse.score
        assert math.log2(coarse.rms / fine.rms) == pytest.approx(1, abs=0.25)
        assert coarse.wobble > 1.9 * fine.wobble
        torch.testing.assert_close(fine.reflection_variation, coarse.reflection_variation, rtol=0.15, atol=0)


def test_principal_meshes_look_smoother_than_others(setup):
    rows = 16
    good = [principal_quads(SADDLE, rows, rows), principal_triangles(SADDLE, rows, rows, along="v")]
    bad = [irregular_triangles(SADDLE, (rows + 1) ** 2), rotated_lattice(SADDLE, rows, rows, math.pi / 4, kind="split"),
           rotated_lattice(SADDLE, rows, rows, math.radians(25), kind="split")]  # fmt: skip
    for chosen in (setup, setup.without_reference()):
        scores = [[reflection_score(m.vertices, m.topology, chosen).score for m in kind] for kind in (good, bad)]
        assert max(scores[0]) < min(scores[1])


def test_wobble_tells_misplaced_vertices_from_facets(setup):
    mesh = principal_quads(SADDLE, 24, 24)
    triangles = irregular_triangles(SADDLE, 625)
    regular = reflection_score(mesh.vertices, mesh.topology, setup)
    noise = torch.randn(len(triangles.vertices), 1, generator=torch.Generator().manual_seed(0), dtype=DOUBLE)
    rough = triangles.vertices + 0.002 * noise * triangles.normals
    assert reflection_score(triangles.vertices, triangles.topology, setup).wobble > 1.3 * regular.wobble
    assert reflection_score(rough, triangles.topology, setup).wobble > 5 * regular.wobble


def test_parts_add_up():
    vertices, topology = torus(12, 8)
    result = reflection_score(vertices, topology, **SMALL)
    camera = result.setup.camera
    assert camera.num_views == 6
    assert result.per_view.shape == (6, 4)
    torch.testing.assert_close(result.score, result.per_view.mean())
    variation = reflection_variation(
        vertices, topology, camera.axes[:, 2], visibility=edge_visibility(vertices, topology, camera, size=192)
    )
    torch.testing.assert_close(
        result.reflection_variation, variation.mean() / face_areas(vertices, topology).sum().sqrt()
    )
    assert result.images.shape == result.reference_images.shape == (6, 4, 96, 96)
    assert ((result.images >= 0) & (result.images <= 1)).all()
    torch.testing.assert_close(result.compared, result.window.to(DOUBLE).mean((-2, -1)))


@pytest.mark.slow
def test_without_reference_is_with_the_mesh_itself_shaded_smoothly():
    vertices, topology = torus(12, 8)
    own = reflection_score(vertices, topology, **SMALL)
    torch.testing.assert_close(
        numbers(reflection_score(vertices, topology, (vertices, topology), **SMALL)), numbers(own)
    )
    smooth = SmoothReference.of_mesh(vertices, topology)
    torch.testing.assert_close(numbers(reflection_score(vertices, topology, smooth, **SMALL)), numbers(own))
    again = reflection_score(vertices, topology, own.setup)
    assert torch.equal(numbers(again), numbers(own))  # deterministic


def test_perspective_views_from_far_away_are_parallel_ones():
    mesh = principal_quads(SADDLE, 12, 12)
    near = OrthographicCamera(torch.tensor([0.3, 0.2, -1]), half_widths=1.2)
    eye = -1e4 * near.directions
    angle = 2 * math.degrees(math.atan(1.2 / 1e4))
    results = [
        reflection_score(mesh.vertices, mesh.topology, SADDLE, camera=camera, frequency=2.0, **SMALL)
        for camera in (near, PerspectiveCamera(eye, fields_of_view=angle))
    ]
    torch.testing.assert_close(*(numbers(r) for r in results), rtol=5e-3, atol=1e-5)


# ---- invariance ----------------------------------------------------------------------------------------


def moved(setup: ReflectionSetup, turn: torch.Tensor, scale: float, shift: float) -> ReflectionSetup:
    camera, reference = setup.camera, setup.reference
    assert isinstance(camera, OrthographicCamera)
    place = lambda x: scale * x @ turn.T + shift  # noqa: E731
    views = OrthographicCamera(
        camera.directions @ turn.T, place(camera.targets), scale * camera.half_widths, camera.axes[:, 1] @ turn.T
    )
    surface = SmoothReference(place(reference.vertices), reference.topology, reference.normals @ turn.T)
    return ReflectionSetup.for_reference(
        surface, camera=views, stripe_directions=setup.stripes.waves @ turn.T,
        frequency=float(setup.stripes.waves[0].norm() / (2 * math.pi)), size=setup.size,
        supersampling=setup.supersampling,
    )  # fmt: skip


@pytest.mark.parametrize(("scale", "shift", "seed"), [(1.0, 0.0, 3), (7.0, 0.0, None), (0.01, -2.0, 5)])
def test_moves_and_scales_with_views_and_stripes(setup, scale, shift, seed):
    mesh = irregular_triangles(SADDLE, 150)
    turn = torch.eye(3, dtype=DOUBLE) if seed is None else random_rotation(seed)
    there = moved(setup, turn, scale, shift)
    value = numbers(reflection_score(mesh.vertices, mesh.topology, setup))
    result = numbers(reflection_score(scale * mesh.vertices @ turn.T + shift, mesh.topology, there))
    torch.testing.assert_close(result, value, rtol=2e-3, atol=0)  # a sample beside an edge may change sides


def test_default_views_and_frequency_scale_with_the_mesh():
    mesh = irregular_triangles(SADDLE, 150)
    values = [numbers(reflection_score(s * mesh.vertices, mesh.topology, **SMALL)) for s in (1.0, 1e-3, 1e3)]
    torch.testing.assert_close(values[1], values[0], rtol=2e-3, atol=0)
    torch.testing.assert_close(values[2], values[0], rtol=2e-3, atol=0)


def test_ignores_numbering_orientation_and_where_flat_faces_are_cut(setup):
    mesh = irregular_triangles(SADDLE, 150)
    value = numbers(reflection_score(mesh.vertices, mesh.topology, setup))
    order = torch.randperm(150, generator=torch.Generator().manual_seed(0))
    place = order.argsort()
    faces = [[int(place[v]) for v in face] for face in mesh.topology.face_lists()]
    for changed in (faces[::-1], [face[::-1] for face in faces]):
        result = reflection_score(mesh.vertices[order], Topology.from_faces(changed), setup)
        torch.testing.assert_close(numbers(result), value, rtol=1e-6, atol=0)
    vertices, topology = cube()
    cut = Topology.from_faces([t for a, b, c, d in topology.face_lists() for t in ([a, b, c], [a, c, d])])
    ball = SmoothReference.of_surface(Sphere(0.8), 40)
    scores = [reflection_score(vertices - 0.5, t, ball, **SMALL) for t in (topology, cut)]
    torch.testing.assert_close(
        numbers(scores[1])[:3], numbers(scores[0])[:3], rtol=1e-6, atol=0
    )  # wobble asks for edges


# ---- nothing to see, and other meshes --------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [
    (torch.zeros(3, 3, dtype=DOUBLE), Topology.from_faces([[0, 1, 2]])),
    (torch.zeros(2, 3, dtype=DOUBLE), Topology.from_faces([], num_vertices=2)),
    (torch.zeros(0, 3), Topology.from_faces([])),
    (torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), Topology.from_faces([[0, 1, 2]])),
], ids=["a point", "no faces", "no vertices", "a line"])  # fmt: skip
def test_of_meshes_without_anything_to_see_all_is_zero(mesh):
    for reference in (None, plate()):
        result = reflection_score(*mesh, reference, **SMALL)
        assert not numbers(result).any()
        assert not result.compared.any()


def test_views_that_show_nothing_do_not_count():
    mesh = principal_quads(SADDLE, 8, 8)
    views = axis_directions()[[5, 5]]
    targets = torch.tensor([[0.0, 0, 0], [50, 0, 0]])
    camera = OrthographicCamera(views, targets, 1.2)
    both = reflection_score(mesh.vertices, mesh.topology, camera=camera, frequency=2.0, **SMALL)
    one = reflection_score(
        mesh.vertices, mesh.topology, camera=OrthographicCamera(views[:1], half_widths=1.2), frequency=2.0, **SMALL
    )
    torch.testing.assert_close(both.score, one.score)
    torch.testing.assert_close(both.rms, one.rms)
    assert not both.per_view[1].any()
    assert both.compared[1] == 0


def test_several_parts_that_hide_each_other_and_show_their_backs():
    vertices, topology = wavy_grid(6, 6, triangles=True)
    count = topology.num_vertices
    faces = topology.face_lists()
    pair = Topology.from_faces(faces + [[v + count for v in face[::-1]] for face in faces])
    below = vertices - torch.tensor([1.0, 0.5, 2.0], dtype=DOUBLE)
    result = reflection_score(torch.cat([vertices, below]), pair, **SMALL)
    assert torch.isfinite(numbers(result)).all()
    assert (numbers(result) > 0).all()


def test_default_views_see_the_front_of_patches_and_all_sides_of_bodies():
    patch = SmoothReference.of_mesh(*plate(0.5))
    views = default_camera(patch).axes[:, 2]
    normal = patch.normals[0]
    assert (views @ -normal).min() > math.cos(math.radians(40)) - 1e-9
    assert views[0] @ -normal == pytest.approx(1)
    body = default_camera(SmoothReference.of_mesh(*cube())).axes[:, 2]
    torch.testing.assert_close(body.T @ body, 2 * torch.eye(3, dtype=DOUBLE))
    assert (body @ body.T).min() == pytest.approx(-1)
    assert body.abs().max() < 0.9  # not along the faces of a box
    assert body.abs().min() > 0.1


def test_single_precision():
    mesh = principal_quads(SADDLE, 8, 8)
    values = [reflection_score(mesh.vertices.to(kind), mesh.topology, **SMALL) for kind in (torch.float32, DOUBLE)]
    assert values[0].score.dtype == torch.float32
    torch.testing.assert_close(*(numbers(v) for v in values), rtol=1e-2, atol=1e-5)


def test_wrong_arguments_are_named():
    vertices, topology = cube()
    with pytest.raises(ShapeError, match="one mesh"):
        reflection_score(vertices[None], topology)
    with pytest.raises(TorchfairError, match="not finite"):
        reflection_score(vertices * math.inf, topology)
    with pytest.raises(TorchfairError, match="reference must be"):
        reflection_score(vertices, topology, vertices)
    with pytest.raises(TorchfairError, match="frequency"):
        reflection_score(vertices, topology, frequency=-1.0)
    with pytest.raises(TorchfairError, match="no reference"):
        _ = ReflectionSetup.for_reference(plate(), **SMALL).without_reference().reference_pictures


def test_sampled_surface_is_the_surface_also_at_poles():
    reference = SmoothReference.of_surface(Sphere(2.0), 24)
    torch.testing.assert_close(reference.normals, reference.vertices / 2)
    assert replace(reference).topology is reference.topology


def test_pictures_compared_are_those_rendered_one_by_one() -> None:
    mesh = irregular_triangles(PrincipalParaboloid(1.0, -0.5, (0.8, 0.8)), 60)
    other = principal_quads(Catenoid(), 6, 12)
    for vertices, topology in ((mesh.vertices, mesh.topology), (other.vertices, other.topology)):
        reference = SmoothReference.of_mesh(vertices, topology)
        chosen = ReflectionSetup.for_reference(reference, size=(40, 48), supersampling=2)
        for setup in (chosen, chosen.without_reference()):
            flat, smooth, triangles = setup.compared(vertices, topology)
            assert all(map(torch.equal, flat, setup.flat(vertices, topology)))
            assert all(map(torch.equal, smooth, setup.pictures_to_match(vertices, topology)))
            cut = triangulate(vertices, topology).triangles
            for seen, points in zip(triangles, setup.camera.project(vertices, (80, 96)), strict=True):
                assert torch.equal(seen, visible_triangles(points, cut, 96, 80))
