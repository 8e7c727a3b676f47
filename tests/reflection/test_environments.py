"""Environments: closed forms, seams and poles of panoramas, derivatives."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from hypothesis import given
from hypothesis import strategies as st
from reflection_tools import vector
from torch import Tensor

from torchfair import ShapeError, TorchfairError
from torchfair.reflection import Checker, EquirectangularImage, Stripes, mirror_directions


def sphere(*shape: int, seed: int = 0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.nn.functional.normalize(torch.randn(*shape, 3, dtype=DOUBLE, generator=generator), dim=-1)


def panorama(function, height: int, width: int) -> Tensor:  # type: ignore[no-untyped-def]
    """A picture of a function of directions, sampled at the texel centres that the docstring states."""
    theta = (torch.arange(height, dtype=DOUBLE) + 0.5)[:, None] * math.pi / height
    azimuth = math.pi - (torch.arange(width, dtype=DOUBLE) + 0.5) * 2 * math.pi / width
    x, y = torch.sin(theta) * torch.cos(azimuth), torch.sin(theta) * torch.sin(azimuth)
    values: Tensor = function(torch.stack([x, y, torch.cos(theta).expand_as(x)], dim=-1))
    return values.movedim(-1, 0)


def test_stripes_are_the_formula() -> None:
    directions, rays = vector(1, 2, 2) / 1.5, sphere(4, 5)
    values = Stripes(directions, frequency=1.25, sharpness=3.0)(rays)
    wave = torch.sin(2 * math.pi * 1.25 * (rays @ (vector(1, 2, 2) / 3)))
    assert values.shape == (4, 5, 1)
    assert torch.allclose(values[..., 0], 0.5 + 0.5 * torch.tanh(3 * wave), atol=1e-14)


def test_several_stripe_directions_are_channels() -> None:
    rays, directions = sphere(6), sphere(4, seed=1)
    together = Stripes(directions, torch.tensor([1.0, 2, 3, 4]))(rays)
    for channel in range(4):
        assert torch.allclose(together[:, channel], Stripes(directions[channel], channel + 1.0)(rays)[:, 0], atol=1e-13)


def test_stripes_have_twice_the_frequency_bright_and_dark_ones_from_pole_to_pole() -> None:
    height = torch.linspace(-1, 1, 4001, dtype=DOUBLE)
    rays = torch.stack([(1 - height**2).clamp(min=0).sqrt(), 0 * height, height], dim=-1)
    bright = Stripes(vector(0, 0, 1), 3.0)(rays)[:, 0] > 0.5
    assert int((bright[1:] != bright[:-1]).sum()) + 1 == 12


def test_checker_changes_sign_across_every_wave() -> None:
    rays = sphere(50)
    values = Checker(torch.eye(3)[:2], 1.5, 4.0)(rays)
    product = torch.sin(3 * math.pi * rays[:, 0]) * torch.sin(3 * math.pi * rays[:, 1])
    assert torch.allclose(values[:, 0], 0.5 + 0.5 * torch.tanh(4 * product), atol=1e-13)
    mirrored = Checker(torch.eye(3)[:2], 1.5, 4.0)(rays * vector(-1, 1, 1))
    assert torch.allclose(values + mirrored, torch.ones(50, 1, dtype=DOUBLE), atol=1e-13)


def test_panorama_has_its_texels_where_it_says() -> None:
    image = torch.rand(3, 6, 10, dtype=DOUBLE, generator=torch.Generator().manual_seed(3))
    centres = panorama(lambda rays: rays, 6, 10).movedim(0, -1)
    assert torch.allclose(EquirectangularImage(image)(centres).movedim(-1, 0), image, atol=1e-12)


def test_panorama_orientation() -> None:
    """Top, bottom, middle, and a quarter to the left of the middle."""
    image = panorama(lambda rays: rays, 90, 180)
    lookup = EquirectangularImage(image)
    for axis in (*torch.eye(3, dtype=DOUBLE), *-torch.eye(3, dtype=DOUBLE)):
        assert torch.allclose(lookup(axis), axis, atol=2e-3)
    top, middle, left = image[2, 0], image[0, 45, 89:91], image[1, 45, 44:46]
    assert bool((top > 0.99).all())
    assert bool((middle > 0.99).all())
    assert bool((left > 0.99).all())


@pytest.mark.parametrize("height", [32, 64, 128])
def test_panorama_of_a_smooth_function_converges_with_second_order(height: int) -> None:
    """Across the seam and the poles too, where neighbours are on the other side."""
    near_pole = torch.nn.functional.normalize(vector(0, 0, 1) + 1e-2 * sphere(200), dim=-1)
    seam = torch.nn.functional.normalize(vector(-1, 0, 0) + 1e-2 * sphere(200, seed=1), dim=-1)
    rays = torch.cat([sphere(500, seed=2), near_pole, -near_pole, seam])
    smooth = lambda r: torch.stack([r[..., 0] * r[..., 1], torch.sin(2 * r[..., 2] + r[..., 0])], dim=-1)  # noqa: E731
    error = (EquirectangularImage(panorama(smooth, height, 2 * height))(rays) - smooth(rays)).abs().max()
    assert error < 10 / height**2


def test_panorama_at_the_poles_is_finite_with_finite_derivatives() -> None:
    rays = torch.cat([vector(0, 0, 1)[None], vector(0, 0, -1)[None], vector(-1, 0, 0)[None]]).requires_grad_()
    image = torch.rand(2, 5, 8, dtype=DOUBLE, generator=torch.Generator().manual_seed(3), requires_grad=True)
    values = EquirectangularImage(image)(rays)
    gradients = torch.autograd.grad(values.sum(), [rays, image])
    assert bool(torch.isfinite(values).all())
    assert all(bool(torch.isfinite(gradient).all()) for gradient in gradients)


def test_turned_panorama() -> None:
    image, turn, rays = torch.rand(2, 6, 12, dtype=DOUBLE), random_rotation(3), sphere(30)
    assert torch.allclose(
        EquirectangularImage(image, turn)(rays), EquirectangularImage(image)(rays @ turn.T), atol=1e-12
    )


@pytest.mark.parametrize(
    "environment",
    [Stripes(torch.eye(3)), Checker(), EquirectangularImage(torch.rand(2, 6, 12, dtype=DOUBLE))],
    ids=["stripes", "checker", "panorama"],
)
def test_environments_are_differentiable_and_follow_the_dtype(environment: torch.nn.Module) -> None:
    rays = sphere(7)
    assert torch.autograd.gradcheck(environment, rays.requires_grad_(), atol=1e-4)
    single = environment(rays.detach().float())
    assert single.dtype == torch.float32
    assert torch.allclose(single.double(), environment(rays.detach()), atol=1e-3)
    assert environment(torch.zeros(0, 3)).shape[0] == 0
    assert environment.state_dict()


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_mirror_is_the_law_of_reflection(numbers: list[float]) -> None:
    d, n = torch.tensor(numbers, dtype=DOUBLE).view(2, 3) + vector(0, 0, 2)
    d, n = d / torch.linalg.vector_norm(d), n / torch.linalg.vector_norm(n)
    r = mirror_directions(d, n)
    assert float(r @ r) == pytest.approx(1)
    assert float(r @ n) == pytest.approx(-float(d @ n))  # same angle, other side
    assert torch.allclose(r - (r @ n) * n, d - (d @ n) * n, atol=1e-12)  # along the mirror nothing changes
    assert torch.allclose(mirror_directions(r, -n), d, atol=1e-12)
    assert torch.equal(mirror_directions(d, 0 * n), d)


@pytest.mark.parametrize(
    ("build", "error", "named"),
    [
        (lambda: Stripes(torch.zeros(3)), TorchfairError, "stripe directions"),
        (lambda: Stripes(torch.eye(2)), ShapeError, "directions"),
        (lambda: Stripes(torch.eye(3), torch.ones(2)), ShapeError, "frequency"),
        (lambda: Stripes(torch.eye(3), -1.0), TorchfairError, "frequency and sharpness"),
        (lambda: Checker(sharpness=0.0), TorchfairError, "frequency and sharpness"),
        (lambda: EquirectangularImage(torch.zeros(4, 8)), ShapeError, "image"),
        (lambda: EquirectangularImage(torch.full((1, 4, 8), math.nan)), TorchfairError, "image must be finite"),
        (lambda: EquirectangularImage(torch.zeros(1, 4, 8), torch.eye(2)), ShapeError, "rotation"),
    ],
)
def test_refusals_name_what_is_wrong(build, error: type[Exception], named: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(error, match=named):
        build()
