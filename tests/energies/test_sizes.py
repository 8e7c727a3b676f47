"""Energies of meshes of any size that the dtype can hold: value and gradient are those of the ordinary size."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.energies import (
    angle_variation,
    normal_variation,
    normal_variation_per_edge,
    total_absolute_curvature,
    total_frobenius_curvature,
    total_mean_curvature,
    willmore_energy,
)
from torchfair.geometry._unit import ordinary_extents, unit_of

Energy = Callable[[Tensor, Topology], Tensor]
LENGTHS: list[Energy] = [
    normal_variation,
    lambda vertices, topology: normal_variation_per_edge(vertices, topology).sum(-1),
    angle_variation,
    total_mean_curvature,
    total_absolute_curvature,
    lambda vertices, topology: total_absolute_curvature(vertices, topology, estimator="corrected"),
    lambda vertices, topology: total_absolute_curvature(vertices, topology, boundary="extrapolated"),
    total_frobenius_curvature,
]
SIZES = [(torch.float32, 2.0**p) for p in (-100, -66, -33, -10, 33, 66, 100)]
SIZES += [(torch.float64, 2.0**p) for p in (-1000, -500, -266, 266, 500, 1000)]
TOLERANCES = {torch.float32: 1e-3, torch.float64: 1e-10}


@pytest.mark.parametrize(("dtype", "size"), SIZES)
def test_values_and_gradients_scale(dtype: torch.dtype, size: float) -> None:
    vertices, topology = wavy_grid(5, 5, triangles=True)
    vertices = vertices.to(dtype)
    for energy in LENGTHS:
        plain, scaled = vertices.clone().requires_grad_(), (size * vertices).requires_grad_()
        before, after = energy(plain, topology), energy(scaled, topology)
        before.backward()
        after.backward()
        assert before > 0.0 or energy is total_mean_curvature
        assert torch.allclose(after / size, before, rtol=TOLERANCES[dtype])
        assert plain.grad is not None
        assert scaled.grad is not None
        assert torch.allclose(scaled.grad, plain.grad, rtol=0.0, atol=TOLERANCES[dtype] * float(plain.grad.abs().max()))
    assert torch.allclose(
        willmore_energy(size * vertices, topology), willmore_energy(vertices, topology), rtol=TOLERANCES[dtype]
    )


def test_meshes_of_a_batch_have_their_own_sizes() -> None:
    vertices, topology = wavy_grid(5, 5)
    sizes = torch.tensor([1.0, 2.0**300, 2.0**-300], dtype=torch.float64)
    values = normal_variation(sizes[:, None, None] * vertices, topology)
    assert torch.allclose(values / sizes, normal_variation(vertices, topology).expand(3), rtol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_ordinary_sizes_are_computed_with_as_they_are(dtype: torch.dtype) -> None:
    """Nothing is divided there, and nothing where there is no extent or no number."""
    vertices = wavy_grid(5, 5)[0].to(dtype)
    low, high = ordinary_extents(dtype)
    extent = float((vertices.amax(0) - vertices.amin(0)).max())
    for size in (1.01 * low / extent, 1.0, 0.99 * high / extent):
        assert unit_of(size * vertices) == 1.0
    for size in (0.99 * low / extent, 2.01 * high / extent):
        assert unit_of(size * vertices) != 1.0
    for places in (0.0 * vertices, 0.0 * vertices + 1e6, vertices[:0]):
        assert unit_of(places) == 1.0
