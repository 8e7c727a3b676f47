"""Derivatives of surfaces are the same numbers, and as often differentiable, in and outside of transforms of torch."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor
from torch.autograd import forward_ad
from torch.func import jacfwd, vmap

from torchfair.shapes import Enneper, FreeFormPatch, Surface, Torus
from torchfair.shapes._forms import _derivatives, _transformed_derivatives

SURFACES: dict[str, Surface] = {"torus": Torus(), "enneper": Enneper(), "free form": FreeFormPatch(2)}
each_surface = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)


def places(surface: Surface, count: int = 7) -> tuple[Tensor, Tensor]:
    shares = torch.linspace(0.1, 0.9, count, dtype=torch.float64)
    (u0, u1), (v0, v1) = surface.domain
    return u0 + (u1 - u0) * shares, v0 + (v1 - v0) * shares.flip(0).square()


@each_surface
def test_both_ways_give_the_same_numbers(surface: Surface) -> None:
    u, v = places(surface)
    for plain, transformed in zip(
        _derivatives(surface._position, u, v), _transformed_derivatives(surface._position, u, v), strict=True
    ):
        assert torch.equal(plain, transformed)
        assert not plain.requires_grad


@each_surface
def test_transforms_see_the_same_function(surface: Surface) -> None:
    """Curvatures by themselves, one point at a time; their derivatives along u, forward and in reverse."""
    u, v = places(surface)
    torch.testing.assert_close(
        vmap(surface.principal_curvatures)(u, v), surface.principal_curvatures(u, v), rtol=1e-12, atol=1e-12
    )
    slope = torch.stack([jacfwd(surface.gaussian_curvature)(a, b) for a, b in zip(u, v, strict=True)])
    u.requires_grad_()
    (reverse,) = torch.autograd.grad(surface.gaussian_curvature(u, v).sum(), u)
    torch.testing.assert_close(reverse, slope, rtol=1e-10, atol=1e-10)
    with forward_ad.dual_level():
        dual = forward_ad.make_dual(u.detach(), torch.ones_like(u))
        pushed = forward_ad.unpack_dual(surface.gaussian_curvature(dual, v)).tangent
    torch.testing.assert_close(pushed, slope, rtol=1e-10, atol=1e-10)


@each_surface
def test_parameters_that_depend_on_each_other_are_apart(surface: Surface) -> None:
    """The partial derivative along u leaves v as it is, even where v was computed from u."""
    u, v = places(surface)
    apart = surface.tangents(u, v)
    u.requires_grad_()
    for found, expected in zip(surface.tangents(u, v + 0.0 * u), apart, strict=True):
        assert torch.equal(found, expected)
        assert found.requires_grad
    line = u.detach().requires_grad_()
    along, across = surface.tangents(line, line)
    single = surface.tangents(line.detach(), line.detach())
    assert torch.equal(along, single[0])
    assert torch.equal(across, single[1])


def test_parameters_of_the_surface_are_followed() -> None:
    """Area elements of a torus scale with its tube; so do second derivatives."""
    tube = torch.tensor(0.5, dtype=torch.float64, requires_grad=True)

    class Ring(Surface):
        domain = ((0.0, 1.0), (0.0, 1.0))

        def _position(self, u: Tensor, v: Tensor) -> Tensor:
            away = 2.0 + tube * v.cos()
            return torch.stack([away * u.cos(), away * u.sin(), tube * v.sin()], dim=-1)

    u, v = places(Ring())
    ring = Ring()
    (slope,) = torch.autograd.grad(ring.tangents(u, v)[1].norm(dim=-1).sum(), tube)  # |x_v| is the tube
    torch.testing.assert_close(slope, torch.tensor(7.0, dtype=torch.float64))
    larger = ring.principal_curvatures(u, v)[:, 0]
    (slope,) = torch.autograd.grad(larger.sum(), tube)  # 1 / tube
    torch.testing.assert_close(slope, torch.tensor(-7.0 / 0.25, dtype=torch.float64))
    with torch.no_grad():
        assert not ring.principal_curvatures(u, v).requires_grad


def test_what_does_not_depend_on_its_parameters_has_no_derivatives() -> None:
    u = torch.zeros(3, dtype=torch.float64)
    values, by_u, by_v = _derivatives(lambda u, v: torch.ones(3, 2, dtype=torch.float64), u, u)
    assert torch.equal(values, torch.ones(3, 2, dtype=torch.float64))
    assert not by_u.any()
    assert not by_v.any()


@each_surface
def test_inference_and_no_grad_give_the_same_numbers(surface: Surface) -> None:
    u, v = places(surface)
    expected = surface.principal_curvatures(u, v)
    with torch.no_grad():
        assert torch.equal(surface.principal_curvatures(u, v), expected)
    with torch.inference_mode():
        torch.testing.assert_close(surface.normal(u, v), surface.normal(u.clone(), v.clone()))
    assert surface.principal_curvatures(u[:0], v[:0]).shape == (0, 2)


def test_numbers_made_under_inference_have_derivatives_outside() -> None:
    with torch.inference_mode():
        u, v = torch.full((3,), 0.3, dtype=torch.float64), torch.linspace(0.1, 0.5, 3, dtype=torch.float64)
    found = Torus().tangents(u, v)
    for of, expected in zip(found, Torus().tangents(u.clone(), v.clone()), strict=True):
        torch.testing.assert_close(of, expected)
