"""What is seen where, and in which colour."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from geometry_meshes import random_polytope, torus
from helpers import DOUBLE, cube, random_rotation, split_quads, wavy_grid
from reflection_tools import STRIPES, VIEWS, each_kind, random_soup, ray_cast, straight_down, vector

from torchfair import Topology
from torchfair.geometry import face_normals, vertex_normals
from torchfair.reflection import (
    OrthographicCamera,
    PerspectiveCamera,
    Stripes,
    mirror_directions,
    render_reflection,
)
from torchfair.triangulation import triangulate

SCENES = {
    "torus": torus,
    "polytope": lambda: random_polytope(3),
    "soup": lambda: random_soup(60, 1),
    "quads not planar": wavy_grid,
    "triangles": lambda: wavy_grid(7, 6, triangles=True, seed=3),
}
each_scene = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)


@each_scene
@each_kind
def test_visible_faces_agree_with_rays(scene, kind: type[OrthographicCamera]) -> None:  # type: ignore[no-untyped-def]
    vertices, topology = scene()
    camera = kind.fit(vertices, directions=VIEWS)
    seen = render_reflection(vertices, topology, camera, STRIPES, size=48).face_index
    assert (seen == ray_cast(vertices, topology, camera, 48)).to(DOUBLE).mean() >= 0.999


@pytest.mark.parametrize("size", [256, 512])
@each_kind
def test_visible_faces_agree_with_embree(kind: type[OrthographicCamera], size: int) -> None:
    pytest.importorskip("embreex")
    trimesh = pytest.importorskip("trimesh")
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    vertices, topology = torus(60, 40)
    vertices = vertices @ random_rotation(5).T
    camera = kind.fit(vertices, directions=VIEWS)
    cut = triangulate(vertices, topology)
    rays = RayMeshIntersector(trimesh.Trimesh(vertices.numpy(), cut.triangles.numpy(), process=False))
    origins, directions = (part.reshape(-1, 3) for part in camera.rays(size))
    if camera.near is None:
        origins = origins - 100 * directions
    hit = rays.intersects_first(origins.numpy(), directions.numpy())
    expected = np.where(hit >= 0, cut.faces.numpy()[hit], -1)
    seen = render_reflection(vertices, topology, camera, STRIPES, size=size).face_index
    assert (seen.view(-1).numpy() == expected).mean() >= 0.999


@each_scene
@each_kind
def test_flat_colours_are_the_mirrored_environment(scene, kind: type[OrthographicCamera]) -> None:  # type: ignore[no-untyped-def]
    vertices, topology = scene()
    camera = kind.fit(vertices, directions=VIEWS)
    image, coverage, faces = render_reflection(vertices, topology, camera, STRIPES, size=20, background=-2.0)
    assert image.shape == (3, 2, 20, 20)
    _, directions = camera.rays(20)
    expected = STRIPES(mirror_directions(directions, face_normals(vertices, topology)[faces]))
    expected = torch.where((faces >= 0)[..., None], expected, -2.0)
    assert torch.allclose(image.movedim(1, -1), expected, atol=1e-12)
    assert torch.equal(coverage, (faces >= 0).to(DOUBLE))


@each_kind
def test_polygons_mirror_as_one_plane(kind: type[OrthographicCamera]) -> None:
    """A cube of squares looks like one of triangles: no seams; one colour per face from afar."""
    vertices, topology = cube()
    camera = kind.fit(vertices, directions=VIEWS)
    squares = render_reflection(vertices, topology, camera, STRIPES, size=64)
    split = Topology.from_faces(split_quads(np.array(topology.face_lists())))
    triangles = render_reflection(vertices, split, camera, STRIPES, size=64)
    assert torch.allclose(squares.image, triangles.image, atol=1e-12)
    assert torch.equal(squares.face_index, torch.where(triangles.face_index < 0, -1, triangles.face_index % 6))
    if camera.near is None:
        colours = squares.image[0].flatten(1).T[squares.face_index[0].view(-1) == squares.face_index[0, 32, 32]]
        assert torch.equal(colours, colours[:1].expand_as(colours))


def test_a_pentagon_that_is_not_convex_is_covered_exactly() -> None:
    corners = torch.tensor([[0, 0, 0], [8, 0, 0], [8, 8, 0], [4, 2, 0], [0, 8, 0]], dtype=DOUBLE) - 4
    seen = render_reflection(corners, Topology.from_faces([[0, 1, 2, 3, 4]]), straight_down(5.0), STRIPES, size=100)
    assert float(seen.coverage.sum()) == pytest.approx(100 * 40, rel=0.01)


@each_kind
def test_both_sides_mirror(kind: type[OrthographicCamera]) -> None:
    vertices, topology = wavy_grid(triangles=True)
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    camera = kind.fit(vertices, directions=VIEWS)
    one, other = (render_reflection(vertices, t, camera, STRIPES, size=30) for t in (topology, turned))
    assert torch.allclose(one.image, other.image, atol=1e-12)
    assert torch.equal(one.face_index, other.face_index)


@each_kind
def test_smooth_shading_blends_normals_straight_in_space(kind: type[OrthographicCamera]) -> None:
    vertices, topology = wavy_grid(triangles=True)
    camera = kind.fit(vertices, directions=VIEWS)
    image, _, faces = render_reflection(vertices, topology, camera, STRIPES, size=24, shading="smooth")
    origins, directions = camera.rays(24)
    view, row, column = torch.nonzero(faces >= 0).unbind(1)
    corners = topology.triangles[faces[view, row, column]]
    origin, direction = origins[view, row, column], directions[view, row, column]
    system = torch.cat([vertices[corners].mT, -direction[:, :, None]], dim=2)  # weights and distance
    system = torch.cat([system, vector(1, 1, 1, 0).expand(len(view), 1, 4)], dim=1)
    right = torch.cat([origin, torch.ones(len(view), 1, dtype=DOUBLE)], dim=1)
    weights = torch.linalg.solve(system, right)[:, :3]
    normals = (weights[..., None] * vertex_normals(vertices, topology)[corners]).sum(1)
    normals = normals / torch.linalg.vector_norm(normals, dim=-1, keepdim=True)
    expected = STRIPES(mirror_directions(direction, normals))
    assert torch.allclose(image[view, :, row, column], expected, atol=1e-9)


@pytest.mark.parametrize("shading", ["flat", "smooth"])
def test_given_normals(shading: str) -> None:
    vertices, topology = wavy_grid()
    camera = PerspectiveCamera.fit(vertices, directions=VIEWS)
    own = (face_normals if shading == "flat" else vertex_normals)(vertices, topology)
    given = render_reflection(vertices, topology, camera, STRIPES, size=20, shading=shading, normals=own)  # type: ignore[arg-type]
    default = render_reflection(vertices, topology, camera, STRIPES, size=20, shading=shading)  # type: ignore[arg-type]
    assert torch.equal(given.image, default.image)
    level = vector(0, 0, 1).expand_as(own)
    plane = render_reflection(vertices, topology, camera, STRIPES, size=20, shading=shading, normals=level)  # type: ignore[arg-type]
    expected = STRIPES(camera.rays(20)[1] * vector(1, 1, -1)).movedim(-1, 1)
    assert torch.allclose(plane.image, torch.where(plane.coverage[:, None] > 0, expected, 0.0), atol=1e-9)


@each_kind
@pytest.mark.parametrize("shading", ["flat", "smooth"])
def test_a_batch_is_its_meshes_one_by_one(kind: type[OrthographicCamera], shading: str) -> None:
    vertices, topology = wavy_grid()
    batch = vertices + 0.1 * torch.randn(
        2, 3, *vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0)
    )
    camera = kind.fit(batch, directions=VIEWS)
    settings = {"size": (16, 24), "supersampling": 2, "antialias": True, "shading": shading}
    together = render_reflection(batch, topology, camera, STRIPES, **settings)  # type: ignore[arg-type]
    assert together.image.shape == (2, 3, 3, 2, 16, 24)
    assert together.coverage.shape == (2, 3, 3, 16, 24)
    assert together.face_index.shape == (2, 3, 3, 32, 48)
    for i in range(2):
        for j in range(3):
            for view in range(3):
                chosen = camera.select(slice(view, view + 1))
                single = render_reflection(batch[i, j], topology, chosen, STRIPES, **settings)  # type: ignore[arg-type]
                assert torch.allclose(together.image[i, j, view], single.image[0], atol=1e-12)
                assert torch.allclose(together.coverage[i, j, view], single.coverage[0], atol=1e-12)
                assert torch.equal(together.face_index[i, j, view], single.face_index[0])


def test_portions_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid()
    batch = torch.stack([vertices, vertices @ random_rotation(1).T, 0.5 * vertices])
    camera = OrthographicCamera.fit(batch, directions=VIEWS)
    whole = render_reflection(batch, topology, camera, STRIPES, size=16, antialias=True)
    for most in (1, 700, 1600):
        monkeypatch.setattr("torchfair.reflection.render._MOST", most)
        parts = render_reflection(batch, topology, camera, STRIPES, size=16, antialias=True)
        assert torch.allclose(parts.image, whole.image, atol=1e-12)
        assert torch.equal(parts.face_index, whole.face_index)


@each_kind
def test_supersampling_averages_the_samples_of_a_finer_picture(kind: type[OrthographicCamera]) -> None:
    vertices, topology = random_soup(40, 2)
    camera = kind.fit(vertices, directions=VIEWS)
    coarse = render_reflection(vertices, topology, camera, STRIPES, size=12, supersampling=3, background=0.25)
    fine = render_reflection(vertices, topology, camera, STRIPES, size=36, background=0.25)
    assert torch.allclose(coarse.image, torch.nn.functional.avg_pool2d(fine.image, 3), atol=1e-12)
    assert torch.allclose(coarse.coverage, torch.nn.functional.avg_pool2d(fine.coverage, 3), atol=1e-12)
    assert torch.equal(coarse.face_index, fine.face_index)


def test_equal_depths_go_to_the_smaller_number() -> None:
    vertices, topology = random_soup(10, 3)
    doubled = torch.cat([vertices, vertices])
    faces = topology.face_lists()
    twice = Topology.from_faces(faces + [[corner + 30 for corner in face] for face in faces])
    camera = OrthographicCamera.fit(vertices, directions=VIEWS)
    once, both = (
        render_reflection(v, t, camera, STRIPES, size=30) for v, t in ((vertices, topology), (doubled, twice))
    )
    assert torch.equal(once.face_index, both.face_index)
    assert torch.equal(once.image, both.image)


def test_rendering_twice_gives_the_same_bits() -> None:
    vertices, topology = random_soup(40, 4)
    camera = PerspectiveCamera.fit(vertices, directions=VIEWS)
    one, two = (render_reflection(vertices, topology, camera, STRIPES, size=30, antialias=True) for _ in range(2))
    assert torch.equal(one.image, two.image)


@each_kind
def test_single_precision(kind: type[OrthographicCamera]) -> None:
    vertices, topology = torus(30, 20)
    camera = kind.fit(vertices, directions=VIEWS)
    double = render_reflection(vertices, topology, camera, STRIPES, size=64)
    single = render_reflection(vertices.float(), topology, camera, STRIPES, size=64)
    assert single.image.dtype == single.coverage.dtype == torch.float32
    same = single.face_index == double.face_index
    assert same.to(DOUBLE).mean() >= 0.999
    difference = (single.image - double.image).abs().amax(1)
    assert difference[same].max() < 1e-3


def test_image_of_a_sphere_is_the_closed_form() -> None:
    """A fine smooth sphere from afar: at distance s from the middle the normal leans by asin(s)."""
    from torchfair.shapes import icosphere

    mesh = icosphere(4)
    camera = OrthographicCamera(vector(0, 0, -1), vector(0, 0, 0), 1.0, vector(0, 1, 0))
    waves = Stripes(torch.eye(3), 0.5, 1.0)
    image, coverage, _ = render_reflection(
        mesh.vertices, mesh.topology, camera, waves, size=100, shading="smooth", normals=mesh.vertices
    )
    ticks = (torch.arange(100, dtype=DOUBLE) + 0.5) / 50 - 1
    y, x = torch.meshgrid(-ticks, ticks, indexing="ij")
    inner = x * x + y * y < 0.9
    z = (1 - x * x - y * y).clamp(min=0).sqrt()
    expected = waves(mirror_directions(vector(0, 0, -1), torch.stack([x, y, z], dim=-1))).movedim(-1, 0)
    assert bool((coverage[0][inner] == 1).all())
    assert (image[0] - expected).abs().amax(0)[inner].max() < 0.02
    assert float(coverage.mean()) == pytest.approx(math.pi / 4, rel=5e-3)


def test_any_function_of_directions_is_an_environment() -> None:
    vertices, topology = wavy_grid()
    camera = OrthographicCamera.fit(vertices, directions=VIEWS)
    image = render_reflection(vertices, topology, camera, lambda rays: rays, size=9, background=0.0).image
    assert torch.allclose(torch.linalg.vector_norm(image, dim=1), (image != 0).any(1).to(DOUBLE))


@pytest.mark.parametrize("scene", [torus, lambda: random_polytope(3), cube], ids=["torus", "polytope", "cube"])
@each_kind
@pytest.mark.parametrize("size", [1, 4])
def test_antialiased_pixels_are_the_limit_of_many_samples(scene, kind: type[OrthographicCamera], size: int) -> None:  # type: ignore[no-untyped-def]
    """Whole bodies that hide themselves, in one pixel or a few."""
    vertices, topology = scene()
    camera = kind.fit(vertices, directions=VIEWS)
    mean = render_reflection(vertices, topology, camera, STRIPES, size=size, antialias=True)
    samples = render_reflection(vertices, topology, camera, STRIPES, size=size, supersampling=600 // size)
    row = size / 600  # of samples: what an edge along the rows may be off by
    assert torch.allclose(mean.coverage, samples.coverage, atol=row)
    if camera.near is None:
        assert torch.allclose(mean.image, samples.image, atol=row)
