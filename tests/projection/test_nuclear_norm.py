"""The smoothed nuclear norm and its quadratic model."""

from __future__ import annotations

from typing import Any

import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from torchfair.projection import SmoothNuclearNorm, symmetric_components, symmetric_matrix
from torchfair.projection.loss import apply_root


def matrices(seed: int, scale: float = 1.0, count: int = 20) -> Tensor:
    random = torch.randn(count, 3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    return scale * (random + random.transpose(1, 2))


def model(loss: SmoothNuclearNorm, place: Tensor, residuals: Tensor) -> Tensor:
    return 0.5 * apply_root(loss.root(place), residuals).square().sum(1)


@given(st.integers(0, 10**6))
def test_components_are_an_isometry(seed: int) -> None:
    given_ = matrices(seed)
    components = symmetric_components(given_)
    torch.testing.assert_close(symmetric_matrix(components), given_)
    torch.testing.assert_close(components.square().sum(1), given_.square().sum((1, 2)))


@given(st.integers(0, 10**6), st.floats(1e-4, 1.0))
def test_the_norm_lies_within_three_epsilon_of_the_sum_of_singular_values(seed: int, epsilon: float) -> None:
    given_ = matrices(seed)
    exact = torch.linalg.svdvals(given_).sum(1)
    value = SmoothNuclearNorm(epsilon).value(symmetric_components(given_))
    assert bool((value <= exact + 1e-12).all())
    assert bool((value >= exact - 3.0 * epsilon).all())


@given(st.integers(0, 10**6), st.floats(1e-3, 1.0), st.sampled_from([1e-3, 0.1, 1.0, 10.0]))
def test_the_model_touches_the_norm_and_lies_above_it(seed: int, epsilon: float, reach: float) -> None:
    loss = SmoothNuclearNorm(epsilon)
    place = symmetric_components(matrices(seed))
    other = place + symmetric_components(matrices(seed + 1, reach))
    rise = model(loss, place, other) - model(loss, place, place)
    assert bool((loss.value(place) + rise >= loss.value(other) - 1e-10).all())

    moving = place.clone().requires_grad_()
    (exact,) = torch.autograd.grad(loss.value(moving).sum(), moving)
    (modelled,) = torch.autograd.grad(model(loss, place, moving).sum(), moving)
    torch.testing.assert_close(modelled, exact, atol=1e-9, rtol=1e-9)


@given(st.integers(0, 10**6))
def test_norm_and_model_do_not_depend_on_the_frame(seed: int) -> None:
    loss = SmoothNuclearNorm(0.1)
    frame = torch.linalg.qr(matrices(seed, count=1)[0])[0]
    place, other = matrices(seed), matrices(seed + 1)
    turned, turned_other = (symmetric_components(frame @ m @ frame.T) for m in (place, other))
    plain, plain_other = symmetric_components(place), symmetric_components(other)
    torch.testing.assert_close(loss.value(turned), loss.value(plain))
    torch.testing.assert_close(model(loss, turned, turned_other), model(loss, plain, plain_other))


def test_a_flat_star_has_no_cost_and_a_finite_model() -> None:
    loss = SmoothNuclearNorm(0.01)
    nothing = torch.zeros(3, 6, dtype=torch.float64)
    assert loss.value(nothing).equal(torch.zeros(3, dtype=torch.float64))
    # Frames are arbitrary there, the model is not: |W|^2 / (2 epsilon).
    other = symmetric_components(matrices(0, count=3))
    torch.testing.assert_close(model(loss, nothing, other), other.square().sum(1) / 0.02)


def second_derivatives(loss: Any, residuals: Tensor, way: Tensor) -> tuple[Tensor, Tensor]:
    """Gradient (n, 6), and second derivatives along a way (n, 6)."""
    there = residuals.clone().requires_grad_()
    (slope,) = torch.autograd.grad(loss.value(there).sum(), there, create_graph=True)
    (bend,) = torch.autograd.grad((slope * way).sum(), there)
    return slope.detach(), bend


def test_second_derivatives_are_finite_where_eigenvalues_coincide() -> None:
    """Those of eigenvalues where these differ; differences of the gradient where two or three are equal."""
    norm = SmoothNuclearNorm(0.3)
    generator = torch.Generator().manual_seed(5)
    residuals, way = (torch.randn(6, 6, generator=generator, dtype=torch.float64) for _ in range(2))
    twice = norm.twice_differentiable()
    torch.testing.assert_close(twice.value(residuals), norm.value(residuals), rtol=1e-13, atol=0.0)
    for found, expected in zip(*(second_derivatives(f, residuals, way) for f in (twice, norm)), strict=True):
        torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-12)
    ray = torch.tensor([0.4, -0.2, 0.9], dtype=torch.float64)
    line = symmetric_components(ray[:, None] * ray)
    sizes = torch.tensor([1.0, 0.0, 1e-9, -1.0, 1e3, 1e-30], dtype=torch.float64)
    for equal in (sizes[:, None] * line, sizes[:, None] * symmetric_components(torch.eye(3, dtype=torch.float64))):
        _, bend = second_derivatives(twice, equal, way)
        sides = [second_derivatives(twice, equal + sign * 1e-6 * way, way)[0] for sign in (1.0, -1.0)]
        torch.testing.assert_close(bend, (sides[0] - sides[1]) / 2e-6, rtol=1e-6, atol=1e-7)
