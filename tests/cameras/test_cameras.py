"""Cameras: what they see fits, and pixels, points and rays agree with each other."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from reflection_tools import EACH_KIND, vector
from torch import Tensor

from torchfair import ShapeError, TorchfairError
from torchfair.cameras import Camera, OrthographicCamera, PerspectiveCamera
from torchfair.reflection import cone_directions

each_kind = pytest.mark.parametrize("kind", EACH_KIND.values(), ids=EACH_KIND)
DIRECTIONS = cone_directions(vector(0.4, -0.3, -1), 170, 5)


def cloud(*shape: int) -> Tensor:
    return torch.rand(shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0)) * vector(3, 1, 2)


@each_kind
@pytest.mark.parametrize("aspect", [1.0, 1.6, 0.5])
def test_fit_leaves_the_margin_and_wastes_nothing(kind: type[OrthographicCamera], aspect: float) -> None:
    points = cloud(4, 50, 3)
    camera = kind.fit(points, directions=DIRECTIONS, margin=0.1, aspect=aspect)
    height, width = 200, round(200 * aspect)
    x, y, _ = camera.project(points.reshape(-1, 3), (height, width)).unbind(-1)
    sides = [x.amin(1) - 0.1 * width, 0.9 * width - x.amax(1), y.amin(1) - 0.1 * height, 0.9 * height - y.amax(1)]
    gaps = torch.stack(sides, dim=1)
    assert gaps.min() > -1e-9
    assert gaps.sort(1).values[:, 1].max() < 1e-9 * width  # two opposite sides are touched
    assert torch.minimum((gaps[:, 0] - gaps[:, 1]).abs(), (gaps[:, 2] - gaps[:, 3]).abs()).max() < 1e-6 * width


@each_kind
@pytest.mark.parametrize(
    "points",
    [torch.zeros(0, 3), torch.ones(1, 3), torch.full((4, 3), torch.nan), torch.tensor([[0.0, 0, 0], [0, 0, 9]])],
)
def test_degenerate_scenes_have_a_camera(kind: type[OrthographicCamera], points: Tensor) -> None:
    camera = kind.fit(points, directions=DIRECTIONS)
    x, y, depth = camera.project(torch.nan_to_num(points).to(DOUBLE), 100).unbind(-1)
    if not points.isnan().any():
        assert bool(((x >= 0) & (x <= 100) & (y >= 0) & (y <= 100) & torch.isfinite(depth)).all())


@each_kind
def test_a_ray_through_a_pixel_meets_the_points_that_are_projected_to_it(kind: type[OrthographicCamera]) -> None:
    camera = kind.fit(cloud(9, 3), directions=DIRECTIONS)
    origins, directions = camera.rays((4, 6))
    assert origins.shape == directions.shape == (5, 4, 6, 3)
    assert torch.allclose(torch.linalg.vector_norm(directions, dim=-1), torch.ones(1, dtype=DOUBLE))
    for distance in (3.0, 7.0):
        for view in range(5):
            points = (origins + distance * directions)[view].reshape(-1, 3)
            pixels = camera.project(points, (4, 6))[view]
            rows, columns = torch.meshgrid(torch.arange(4), torch.arange(6), indexing="ij")
            expected = torch.stack([columns, rows], dim=-1).reshape(-1, 2) + 0.5
            assert torch.allclose(pixels[:, :2], expected.to(DOUBLE), atol=1e-9)
            assert torch.allclose(camera.view_directions(points)[view], directions[view].reshape(-1, 3), atol=1e-12)


@each_kind
def test_directions_of_places_one_by_one(kind: type[OrthographicCamera]) -> None:
    camera = kind.fit(cloud(9, 3), directions=DIRECTIONS)
    pixels = 50 * torch.rand(5, 7, 2, dtype=DOUBLE)
    flat = camera.directions_at(pixels.view(-1, 2), 50, torch.arange(5).repeat_interleave(7))
    assert torch.allclose(flat.view(5, 7, 3), camera.directions_at(pixels, 50), atol=1e-15)
    points = cloud(9, 3)
    one_by_one = camera.to_screen(camera.local(points).view(-1, 3), 50, torch.arange(5).repeat_interleave(9))
    assert torch.equal(one_by_one.view(5, 9, 3), camera.project(points, 50))


@each_kind
def test_right_is_right_and_up_is_up(kind: type[OrthographicCamera]) -> None:
    camera = kind.fit(cloud(9, 3), directions=vector(0, 1, 0))
    origin, x, z, y = camera.project(
        vector(1, 0.5, 1) + torch.cat([torch.zeros(1, 3), 0.1 * torch.eye(3)[[0, 2, 1]]]), 80
    )[0]
    assert x[0] > origin[0]
    assert z[1] < origin[1]
    assert y[2] > origin[2]  # depth grows away from the eye


@each_kind
def test_axes_are_a_rotation_even_where_up_is_the_line_of_sight(kind: type[OrthographicCamera]) -> None:
    directions = torch.cat([DIRECTIONS, torch.eye(3, dtype=DOUBLE), -torch.eye(3, dtype=DOUBLE)])
    camera = kind.fit(cloud(9, 3), directions=directions)
    right, up, forward = camera.axes.unbind(1)
    assert torch.allclose(camera.axes @ camera.axes.mT, torch.eye(3, dtype=DOUBLE).expand(11, 3, 3), atol=1e-14)
    assert torch.allclose(torch.linalg.cross(right, forward), up, atol=1e-14)
    assert torch.allclose(forward, torch.nn.functional.normalize(directions, dim=-1), atol=1e-14)


@each_kind
def test_turning_scene_and_views_together_changes_nothing(kind: type[OrthographicCamera]) -> None:
    points, turn = cloud(9, 3), random_rotation(4)
    camera = kind.fit(points, directions=DIRECTIONS)
    turned = kind.fit(points @ turn.T, directions=DIRECTIONS @ turn.T, ups=turn[:, 2])
    assert torch.allclose(turned.project(points @ turn.T, 90), camera.project(points, 90), atol=1e-9)


@each_kind
def test_some_of_the_views(kind: type[OrthographicCamera]) -> None:
    points = cloud(9, 3)
    camera = kind.fit(points, directions=DIRECTIONS)
    for chosen in (slice(1, 3), torch.tensor([4, 0])):
        assert torch.equal(camera.select(chosen).project(points, 64), camera.project(points, 64)[chosen])


def test_perspective_depth_is_affine_on_the_screen() -> None:
    """Straight lines stay straight, in pixel coordinates with depth."""
    camera = PerspectiveCamera(vector(3, 2, 1), vector(0, 0, 0), 40.0)
    ends = torch.tensor([[0.5, 0, -0.3], [-0.4, 0.2, 0.6]], dtype=DOUBLE)
    a, m, b = camera.project(torch.stack([ends[0], 0.3 * ends[0] + 0.7 * ends[1], ends[1]]), 300)[0]
    assert torch.linalg.vector_norm(torch.linalg.cross(m - a, b - a)) < 1e-9 * torch.linalg.vector_norm(b - a) ** 2


def test_field_of_view_spans_the_width() -> None:
    camera = PerspectiveCamera(vector(0, 0, 5), vector(0, 0, 0), 90.0, vector(0, 1, 0))
    pixels = camera.project(vector(5, 0, 0)[None], (30, 60))[0, 0]
    assert torch.allclose(pixels, vector(60, 15, -0.2))
    assert float(camera.near) == pytest.approx(5e-4)
    assert bool(camera.project(torch.tensor([[0.0, 0, 5], [0, 0, 6]]), 60).isnan().all(-1).all())


def test_half_width_spans_the_width() -> None:
    camera = OrthographicCamera(vector(0, 0, -2), vector(0, 0, 0), 3.0, vector(0, 1, 0))
    assert torch.allclose(camera.project(vector(3, 1, 0.5)[None], (30, 60))[0, 0], vector(60, 5, -0.5))
    assert camera.near is None


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_projection_follows_the_dtype_and_is_differentiable(dtype: torch.dtype) -> None:
    for kind in EACH_KIND.values():
        camera: Camera = kind.fit(cloud(9, 3), directions=DIRECTIONS)
        assert camera.project(cloud(2, 9, 3).to(dtype), 64).shape == (2, 5, 9, 3)
        assert camera.project(cloud(9, 3).to(dtype), 64).dtype == dtype
        if dtype == DOUBLE:
            assert torch.autograd.gradcheck(lambda x: camera.project(x, 64), cloud(2, 3).requires_grad_())  # noqa: B023


@pytest.mark.parametrize(
    ("build", "error", "named"),
    [
        (lambda: OrthographicCamera(vector(0, 0, 0)), TorchfairError, "direction that is not zero"),
        (lambda: OrthographicCamera(vector(0, 0, math.nan)), TorchfairError, "directions must be finite"),
        (lambda: OrthographicCamera(vector(0, 1)), ShapeError, "directions"),
        (lambda: OrthographicCamera(DIRECTIONS, torch.zeros(4, 3)), ShapeError, "targets"),
        (lambda: OrthographicCamera(DIRECTIONS, half_widths=0.0), TorchfairError, "half_widths"),
        (lambda: OrthographicCamera(DIRECTIONS, half_widths=torch.ones(3)), ShapeError, "half_widths"),
        (lambda: PerspectiveCamera(vector(1, 1, 1), vector(1, 1, 1)), TorchfairError, "eye must not be at its target"),
        (lambda: PerspectiveCamera(vector(1, 1, 1), fields_of_view=180.0), TorchfairError, "fields_of_view"),
        (lambda: OrthographicCamera(DIRECTIONS).project(torch.zeros(4, 3), (0, 5)), ShapeError, "size"),
        (lambda: OrthographicCamera.fit(cloud(3, 3), directions=DIRECTIONS, margin=0.5), TorchfairError, "margin"),
        (lambda: PerspectiveCamera.fit(cloud(3, 3), directions=DIRECTIONS, aspect=-1.0), TorchfairError, "aspect"),
    ],
)  # fmt: skip
def test_refusals_name_what_is_wrong(build, error: type[Exception], named: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(error, match=named):
        build()
