"""Rendering what is hardly there: nothing in sight, no faces, no meshes, faces of any size, wrong requests."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from geometry_meshes import torus
from helpers import DOUBLE, grid_faces, split_quads, wavy_grid
from reflection_tools import STRIPES, VIEWS, each_kind, straight_down, vector
from torch import Tensor

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.reflection import (
    OrthographicCamera,
    PerspectiveCamera,
    render_reflection,
)

TRIANGLE = torch.tensor([[-3.1, -2.2, 0], [4.3, -1, 0.5], [0.7, 5.1, 1]], dtype=DOUBLE)
INVISIBLE = {
    "beside the picture": TRIANGLE + 100,
    "all at one point": 0 * TRIANGLE,
    "a line": torch.tensor([[0.0, 0, 0], [1, 1, 0], [2, 2, 0]]),
    "on edge": torch.tensor([[0.0, 0, 0], [0, 0, 1], [0, 0, 2]]),
}


@pytest.mark.parametrize("vertices", INVISIBLE.values(), ids=INVISIBLE)
@pytest.mark.parametrize("antialias", [False, True])
def test_where_nothing_is_seen_there_is_background(vertices: Tensor, antialias: bool) -> None:
    topology = Topology.from_faces([[0, 1, 2]])
    for camera in (straight_down(10.0), PerspectiveCamera(vector(0, 0, 12), vector(0, 0, 0), 80.0)):
        points = vertices.to(DOUBLE).requires_grad_()
        background = vector(0.3, 0.7)
        image, coverage, faces = render_reflection(
            points, topology, camera, STRIPES, size=16, background=background, antialias=antialias
        )
        assert torch.equal(image, background[:, None, None].expand_as(image))
        assert bool((coverage == 0).all())
        assert bool((faces == -1).all())
        (gradient,) = torch.autograd.grad(image.sum() + coverage.sum(), points)
        assert torch.equal(gradient, torch.zeros_like(points))


def test_a_mesh_without_faces() -> None:
    nothing = Topology.from_faces(np.zeros((0, 3), int), 4)
    seen = render_reflection(torch.rand(2, 4, 3), nothing, OrthographicCamera(VIEWS), STRIPES, size=8, antialias=True)
    assert seen.image.shape == (2, 3, 2, 8, 8)
    assert bool((seen.coverage == 0).all())


@each_kind
@pytest.mark.parametrize("size", [1, 7])
def test_faces_larger_and_smaller_than_pixels(kind: type[OrthographicCamera], size: int) -> None:
    """A tiny picture of a fine mesh, and one face that reaches far beyond the picture."""
    vertices, topology = torus(30, 20)
    camera = kind.fit(vertices, directions=VIEWS)
    fine = render_reflection(vertices, topology, camera, STRIPES, size=size, supersampling=3, antialias=True)
    whole = render_reflection(vertices, topology, camera, STRIPES, size=size, antialias=True)
    assert torch.allclose(whole.coverage, fine.coverage, atol=1e-6)
    if camera.near is None:
        assert torch.allclose(whole.image, fine.image, atol=1e-6)
    huge = torch.tensor([[-1e6, -1e6, -0.5], [1e6, -1e6, -0.5], [0, 1e6, -0.5]], dtype=DOUBLE)
    whole = render_reflection(huge, Topology.from_faces([[0, 1, 2]]), kind(-vector(0, 0, 1)), STRIPES, size=size)
    assert bool((whole.coverage == 1).all())


@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]]])
def test_ground_that_passes_under_and_behind_the_eye(faces: list[list[int]]) -> None:
    """What is behind the eye is cut away; the horizon is where it should be."""
    ground = torch.tensor([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], dtype=DOUBLE)
    camera = PerspectiveCamera(vector(0, 0, 2), vector(5, 1, 1.5), 60.0)
    seen = render_reflection(ground, Topology.from_faces(faces), camera, STRIPES, size=(40, 60))
    origins, directions = camera.rays((40, 60))
    distance = -origins[..., 2] / directions[..., 2]
    places = origins + distance[..., None] * directions
    assert torch.equal(seen.face_index >= 0, (distance > 0) & (places[..., :2].abs() < 50).all(-1))
    flipped = STRIPES(directions * vector(1, 1, -1)).movedim(-1, 1)
    assert torch.allclose(seen.image, torch.where(seen.coverage[:, None] > 0, flipped, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "error", "named"),
    [
        ({"vertices": torch.zeros(4, 3)}, ShapeError, "vertices"),
        ({"vertices": torch.full((30, 3), math.nan)}, TorchfairError, "a vertex is not finite"),
        ({"size": 0}, ShapeError, "size"),
        ({"supersampling": 0}, TorchfairError, "supersampling"),
        ({"shading": "phong"}, TorchfairError, "shading"),
        ({"normals": torch.zeros(30, 3)}, ShapeError, "normals for flat shading"),
        ({"normals": torch.zeros(20, 3), "shading": "smooth"}, ShapeError, "normals for smooth shading"),
        ({"background": torch.zeros(3)}, ShapeError, "background"),
        ({"environment": lambda rays: rays[..., 0]}, ShapeError, "values of the environment"),
    ],
)
def test_refusals_name_what_is_wrong(change: dict[str, object], error: type[Exception], named: str) -> None:
    vertices, topology = wavy_grid()
    camera = OrthographicCamera(VIEWS)
    arguments = {"vertices": vertices, "topology": topology, "camera": camera, "environment": STRIPES, "size": 8}
    with pytest.raises(error, match=named):
        render_reflection(**(arguments | change))  # type: ignore[arg-type]


def test_grid_on_pixel_centres_and_borders_is_covered_once() -> None:
    """Vertices and edges exactly on samples: every sample belongs to one face, every area is counted once."""
    x, y = torch.meshgrid(torch.arange(8, dtype=DOUBLE), torch.arange(8, dtype=DOUBLE), indexing="ij")
    plane = torch.stack([x.flatten(), y.flatten(), 0 * x.flatten()], dim=1)
    topology = Topology.from_faces(split_quads(grid_faces(8, 8)))
    for scale in (0.5, 1.0, 2.0):
        for shift in (vector(-5, -5, 0), vector(-5.5, -5.5, 0), vector(-5.25, -5.5, 0)):
            mean = render_reflection(
                scale * plane + shift, topology, straight_down(10.0), STRIPES, size=20, antialias=True
            )
            assert float(mean.coverage.sum()) == pytest.approx((7 * scale) ** 2, abs=1e-6)
            assert -1e-6 < float(mean.coverage.min()) <= float(mean.coverage.max()) < 1 + 1e-6
            colour = mean.image.amax((-1, -2), keepdim=True)
            assert torch.allclose(mean.image, mean.coverage[:, None] * colour, atol=1e-6)


@pytest.mark.parametrize("shading", ["flat", "smooth"])
@pytest.mark.parametrize("batch", [(0,), (2, 0)])
def test_no_meshes_have_no_pictures(shading: str, batch: tuple[int, ...]) -> None:
    vertices, topology = wavy_grid(4, 4)
    nothing = vertices.expand(*batch, -1, -1).clone().requires_grad_()
    camera = straight_down(2.0)
    one = render_reflection(vertices, topology, camera, STRIPES, size=(6, 8), shading=shading)  # type: ignore[arg-type]
    found = render_reflection(nothing, topology, camera, STRIPES, size=(6, 8), shading=shading)  # type: ignore[arg-type]
    for empty, full in zip(found, one, strict=True):
        assert empty.shape == (*batch, *full.shape)
        assert empty.dtype == full.dtype
    found[0].sum().backward()
    assert nothing.grad is not None
    assert nothing.grad.shape == nothing.shape
