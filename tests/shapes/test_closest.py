"""Closest points on smooth surfaces: offsets along normals lead back, borders end surfaces, errors name places."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE

from torchfair import MeshError, ShapeError, TorchfairError
from torchfair.shapes import (
    Canopy,
    ClosestOnLevelSet,
    ClosestOnSurface,
    Cylinder,
    Enneper,
    FreeFormPatch,
    Helicoid,
    Paraboloid,
    Sphere,
    Surface,
    Torus,
    closest_on_height_field,
)

SURFACES = [
    (Sphere(1.5), 1.2),
    (Torus(2.0, 0.8), 0.6),
    (Cylinder(), 0.8),
    (Paraboloid(), 0.3),
    (Enneper(), 0.3),
    (FreeFormPatch(), 0.02),
    (Helicoid(), 0.3),
    (Canopy(), 0.05),
]
each_surface = pytest.mark.parametrize(("surface", "reach"), SURFACES, ids=lambda x: getattr(type(x), "__name__", ""))


def places(surface: Surface, count: int = 200, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Random points inside a surface and its normals there."""
    generator = torch.Generator().manual_seed(seed)
    low, high = torch.tensor(surface.domain, dtype=DOUBLE).unbind(1)
    u, v = (low + (high - low) * torch.rand(count, 2, generator=generator, dtype=DOUBLE)).unbind(1)
    return surface.position(u, v), surface.normal(u, v)


@each_surface
def test_offsets_along_normals_lead_back_to_rounding(surface: Surface, reach: float) -> None:
    points, normals = places(surface)
    offsets = reach * torch.linspace(-1, 1, len(points), dtype=DOUBLE)[:, None]
    positions, found = ClosestOnSurface(surface)(points + offsets * normals)
    torch.testing.assert_close(positions, points, atol=1e-13, rtol=0)
    torch.testing.assert_close(found, normals, atol=1e-12, rtol=0)


@each_surface
def test_never_farther_than_the_nearest_of_many_samples(surface: Surface, reach: float) -> None:
    """Also where the foot is on the boundary, and far from the surface."""
    samples, _ = places(surface, 20_000, seed=1)
    points = 1.5 * torch.randn(60, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(2))
    positions, normals = ClosestOnSurface(surface)(points)
    distances = torch.linalg.vector_norm(points - positions, dim=1)
    assert (distances <= torch.cdist(points, samples).amin(1) + 1e-12).all()
    torch.testing.assert_close(torch.linalg.vector_norm(normals, dim=1), torch.ones(60, dtype=DOUBLE))


def test_poles_are_no_traps_and_the_rim_of_a_cylinder_ends_it() -> None:
    poles = torch.tensor([[0.0, 0, 2.0], [1e-9, 0, -3.0], [0.01, 0.02, 2.0]], dtype=DOUBLE)
    positions, _ = ClosestOnSurface(Sphere(1.0))(poles)
    torch.testing.assert_close(positions, poles / torch.linalg.vector_norm(poles, dim=1, keepdim=True))
    above = torch.tensor([[2.0, 0.0, 5.0]], dtype=DOUBLE)
    positions, normals = ClosestOnSurface(Cylinder(1.0, 2.0))(above)
    torch.testing.assert_close(positions, torch.tensor([[1.0, 0.0, 2.0]], dtype=DOUBLE))
    torch.testing.assert_close(normals, torch.tensor([[1.0, 0.0, 0.0]], dtype=DOUBLE))


def test_level_sets_of_a_torus_and_a_sphere() -> None:
    torus = ClosestOnLevelSet(lambda p: (torch.sqrt(p[0] ** 2 + p[1] ** 2) - 2.0) ** 2 + p[2] ** 2 - 0.64)
    points, normals = places(Torus(2.0, 0.8))
    offsets = 0.6 * torch.linspace(-1, 1, len(points), dtype=DOUBLE)[:, None]
    positions, found = torus(points + offsets * normals)
    torch.testing.assert_close(positions, points, atol=1e-12, rtol=0)
    torch.testing.assert_close(found, normals, atol=1e-12, rtol=0)
    far = 5.0 * torch.randn(50, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(3))
    for ball in (lambda p: p.square().sum() - 4.0, lambda p: torch.linalg.vector_norm(p) - 2.0):
        positions, normals = ClosestOnLevelSet(ball)(far)
        torch.testing.assert_close(positions, 2.0 * normals)
        torch.testing.assert_close(normals, far / torch.linalg.vector_norm(far, dim=1, keepdim=True))


def test_height_fields_are_those_of_the_paraboloid() -> None:
    surface = Paraboloid(1.0, -0.5, (1.0, 1.0))
    points, normals = places(surface)
    offsets = 0.5 * torch.linspace(-1, 1, len(points), dtype=DOUBLE)[:, None]
    closest = closest_on_height_field(lambda x, y: 0.5 * (x * x - 0.5 * y * y))
    positions, found = closest(points + offsets * normals)
    torch.testing.assert_close(positions, points, atol=1e-12, rtol=0)
    torch.testing.assert_close(found, -normals, atol=1e-12, rtol=0)


def test_dtype_is_kept_and_no_points_give_none() -> None:
    for closest in (ClosestOnSurface(Torus()), closest_on_height_field(lambda x, y: x * y)):
        positions, normals = closest(torch.rand(4, 3, dtype=torch.float32))
        assert positions.dtype == normals.dtype == torch.float32
        assert closest(torch.rand(0, 3, dtype=DOUBLE))[0].shape == (0, 3)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(MeshError, match=r"not reached from 2 points, first \[0, 1\]"):
        ClosestOnLevelSet(lambda p: p.square().sum() + 1.0)(torch.rand(2, 3, dtype=DOUBLE))
    with pytest.raises(ShapeError, match="points"):
        ClosestOnSurface(Sphere())(torch.rand(3, 2))
    with pytest.raises(TorchfairError, match="samples"):
        ClosestOnSurface(Sphere(), samples=1)


def test_all_of_a_torus_is_at_its_radius_from_the_core() -> None:
    """From the core circle every point of the tube is equally near: one of them is found."""
    angles = torch.linspace(0, 2 * math.pi, 9, dtype=DOUBLE)
    core = 2.0 * torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], dim=1)
    positions, _ = ClosestOnSurface(Torus(2.0, 0.8))(core)
    torch.testing.assert_close(torch.linalg.vector_norm(positions - core, dim=1), torch.full((9,), 0.8, dtype=DOUBLE))
