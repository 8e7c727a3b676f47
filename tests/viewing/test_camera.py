from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, random_rotation, wavy_grid

from torchfair import ShapeError
from torchfair.viewing.camera import eye_axes, fit_camera, towards_eye

UP = torch.tensor([0.0, 0, 1], dtype=DOUBLE)
ASLANT = torch.tensor([1.0, -2, 1.5], dtype=DOUBLE)


def cloud(*shape: int) -> torch.Tensor:
    """Points in the unit cube, always the same ones."""
    return torch.rand(shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("field_of_view", [0.0, 24.0, 70.0])
@pytest.mark.parametrize("size", [(400, 300), (300, 400)])
def test_fit_leaves_the_margin_and_wastes_nothing(field_of_view: float, size: tuple[int, int]) -> None:
    points = cloud(200, 3) * torch.tensor([3.0, 1, 2])
    width, height = size
    camera, size = fit_camera(
        points, towards_eye=ASLANT, up=UP, width=width, height=height, field_of_view=field_of_view, margin=0.1
    )
    x, y, _ = camera.project(points, size)[0].unbind(-1)
    sides = torch.stack([x.min() - 0.1 * width, 0.9 * width - x.max(), y.min() - 0.1 * height, 0.9 * height - y.max()])
    assert sides.min() > -1e-9
    assert torch.sort(sides).values[1] < 1e-9 * width  # touches two opposite sides
    assert abs(float(sides[0] - sides[1])) < 1e-6 * width or abs(float(sides[2] - sides[3])) < 1e-6 * height


@pytest.mark.parametrize("field_of_view", [0.0, 30.0])
def test_depth_grows_away_from_the_eye(field_of_view: float) -> None:
    box = cloud(20, 3)
    camera, size = fit_camera(box, towards_eye=ASLANT, up=UP, width=100, height=100, field_of_view=field_of_view)
    line = -torch.linspace(0, 1, 5, dtype=DOUBLE)[:, None] * ASLANT
    assert bool((camera.project(line, size)[0][:, 2].diff() > 0).all())


def test_perspective_depth_is_affine_on_the_screen() -> None:
    """Straight lines stay straight, in screen coordinates with depth: three points in space map to three collinear."""
    points = wavy_grid()[0]
    camera, size = fit_camera(points, towards_eye=ASLANT, up=UP, width=300, height=200, field_of_view=50)
    start, stop = points[0], points[-1]
    a, m, b = camera.project(torch.stack([start, 0.3 * stop + 0.7 * start, stop]), size)[0]
    assert torch.linalg.vector_norm(torch.linalg.cross(m - a, b - a)) < 1e-9 * torch.linalg.vector_norm(b - a)


def test_up_and_right_on_the_screen() -> None:
    points = cloud(20, 3)
    front = torch.tensor([0.0, -1, 0], dtype=DOUBLE)
    camera, size = fit_camera(points, towards_eye=front, up=UP, width=100, height=100)
    places = torch.tensor([[0.5, 0.5, 0.5], [0.6, 0.5, 0.5], [0.5, 0.5, 0.6]], dtype=DOUBLE)
    origin, x, z = camera.project(places, size)[0]
    assert x[0] > origin[0]
    assert x[1] == pytest.approx(origin[1])
    assert z[1] < origin[1]
    assert z[0] == pytest.approx(origin[0])


def test_points_behind_the_eye_are_not_a_number() -> None:
    points = cloud(20, 3)
    camera, size = fit_camera(points, towards_eye=UP, up=ASLANT, width=100, height=100)
    behind = camera.origins + torch.tensor([[0.0, 0, 0], [0, 0, 1]], dtype=DOUBLE)
    assert bool(camera.project(behind, size)[0].isnan().any(-1).all())


def test_several_meshes_share_the_view() -> None:
    first = cloud(30, 3)
    second = first + torch.tensor([5.0, 0, 0], dtype=DOUBLE)
    camera, size = fit_camera(first, second, towards_eye=ASLANT, up=UP, width=200, height=100)
    x, y, _ = camera.project(torch.cat([first, second]), size)[0].unbind(-1)
    assert bool(((x > 0) & (x < 200) & (y > 0) & (y < 100)).all())


@pytest.mark.parametrize("shape", [(4.0, 1.0), (1.0, 1.0), (1.0, 6.0)])
def test_height_follows_the_proportions(shape: tuple[float, float]) -> None:
    points = cloud(50, 3) * torch.tensor([shape[0], 0.1, shape[1]])
    front = torch.tensor([0.0, -1, 0], dtype=DOUBLE)
    _, size = fit_camera(points, towards_eye=front, up=UP, width=1000)
    assert 350 <= size[0] <= 900
    extent = points.amax(0) - points.amin(0)
    expected = min(max(float(extent[2] / extent[0]), 0.35), 0.9) * 1000
    assert size[0] == pytest.approx(expected, abs=1)


@pytest.mark.parametrize("field_of_view", [0.0, 24.0])
@pytest.mark.parametrize(
    "points",
    [
        torch.zeros(0, 3),
        torch.ones(1, 3),
        torch.full((4, 3), torch.nan),
        torch.tensor([[0.0, 0, 0], [0, 0, 9]]),
        torch.tensor([[torch.inf, 0, 0], [0, 0, 0], [1, 1, 1]]),
    ],
)
def test_degenerate_scenes_have_a_camera(points: torch.Tensor, field_of_view: float) -> None:
    camera, size = fit_camera(points, towards_eye=UP, up=UP, width=80, height=60, field_of_view=field_of_view)
    finite = points[torch.isfinite(points).all(-1)].to(DOUBLE)
    x, y, z = camera.project(finite, size)[0].unbind(-1)
    assert bool(((x > 0) & (x < 80) & (y > 0) & (y < 60) & torch.isfinite(z)).all())


def test_rays_to_the_eye() -> None:
    points = cloud(7, 3)
    camera, _ = fit_camera(points, towards_eye=ASLANT, up=UP, width=80, height=60)
    direction = towards_eye(camera, points)
    reached = points + direction * torch.linalg.vector_norm(camera.origins - points, dim=-1, keepdim=True)
    assert torch.allclose(reached, camera.origins.expand_as(reached))
    assert torch.equal(towards_eye(camera, camera.origins), torch.zeros(1, 3, dtype=DOUBLE))
    parallel, _ = fit_camera(points, towards_eye=ASLANT, up=UP, width=80, height=60, field_of_view=0)
    assert torch.allclose(towards_eye(parallel, points), (ASLANT / torch.linalg.vector_norm(ASLANT)).expand(7, 3))


def test_more_pixels_show_the_same_view() -> None:
    points = cloud(2, 9, 3)
    camera, size = fit_camera(points, towards_eye=ASLANT, up=UP, width=80, height=60)
    assert size == (60, 80)
    assert torch.allclose(camera.project(points, (180, 240))[..., :2], 3 * camera.project(points, size)[..., :2])


def test_axes_are_a_rotation_even_when_up_is_the_line_of_sight() -> None:
    for up in (UP, ASLANT, -2 * ASLANT, torch.zeros(3)):
        axes = eye_axes(ASLANT, up)
        assert torch.allclose(axes @ axes.T, torch.eye(3, dtype=DOUBLE), atol=1e-14)
        assert torch.linalg.det(axes) == pytest.approx(1)
    assert eye_axes(ASLANT, UP)[0] @ UP == pytest.approx(0)


def test_turning_scene_and_view_together_changes_nothing() -> None:
    points, turn = wavy_grid()[0], random_rotation(4)
    camera, size = fit_camera(points, towards_eye=ASLANT, up=UP, width=200, height=150)
    turned, _ = fit_camera(points @ turn.T, towards_eye=turn @ ASLANT, up=turn @ UP, width=200, height=150)
    assert torch.allclose(turned.project(points @ turn.T, size)[0], camera.project(points, size)[0], atol=1e-9)


def test_refusals() -> None:
    with pytest.raises(ShapeError, match="towards_eye"):
        fit_camera(cloud(3, 3), towards_eye=torch.zeros(3), up=UP, width=10, height=10)
    with pytest.raises(ShapeError, match="width and height"):
        fit_camera(cloud(3, 3), towards_eye=UP, up=UP, width=0, height=10)
