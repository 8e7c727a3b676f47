"""Jobs that stay close to a surface given as a function: distances of the result from the exact surface."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor
from torch.linalg import vector_norm

from torchfair import MeshError, ShapeError
from torchfair.energies import normal_variation
from torchfair.formfinding import FairSettings, SymmetricSettings, minimise_normal_variation, principal_symmetric
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import (
    ClosestOnSurface,
    Paraboloid,
    Sphere,
    Torus,
    closest_on_height_field,
    icosphere,
    irregular_triangles,
    principal_triangles,
)

QUICK = replace(FairSettings().projection, max_iterations=20)


def noisy(vertices: Tensor, size: float) -> Tensor:
    generator = torch.Generator().manual_seed(0)
    return vertices + size * torch.randn(vertices.shape, dtype=DOUBLE, generator=generator)


@pytest.mark.parametrize("scale", [1.0, pytest.param(1000.0, marks=pytest.mark.slow)])
def test_a_noisy_sphere_returns_to_the_exact_sphere(scale: float) -> None:
    mesh = icosphere(1)
    start = scale * noisy(mesh.vertices, 0.01) + 5.0 * scale
    reference = ClosestOnSurface(Sphere(scale))
    centre = torch.full((3,), 5.0 * scale, dtype=DOUBLE)

    def ball(points: Tensor) -> tuple[Tensor, Tensor]:
        positions, normals = reference(points - centre)
        return positions + centre, normals

    settings = FairSettings(closeness_weight=1e4, distance_limit=None, projection=QUICK)
    result = minimise_normal_variation(start, mesh.topology, reference=ball, settings=settings)
    before, after = ((vector_norm(v - centre, dim=1) / scale - 1.0).abs().max() for v in (start, result.vertices))
    assert after < 0.03 * before
    assert result.after["largest_distance"] == pytest.approx(float(after) * scale, rel=1e-6)
    assert result.after["largest_distance_back"] <= 2.0 * vector_norm(mesh.vertices[0] - mesh.vertices[1]) * scale


@pytest.mark.slow
def test_vertices_slide_on_the_exact_torus_and_lower_the_energy() -> None:
    surface = Torus(2.0, 0.8)
    mesh = irregular_triangles(surface, 120)
    reference = ClosestOnSurface(surface)
    settings = FairSettings(closeness_weight=1e3, crease_angle=0.0, projection=QUICK)  # coarse, not sharp
    result = minimise_normal_variation(mesh.vertices, mesh.topology, reference=reference, settings=settings)
    assert result.after["normal_variation"] < 0.9 * float(normal_variation(mesh.vertices, mesh.topology))
    positions, _ = reference(result.vertices)
    distance = vector_norm(positions - result.vertices, dim=1).max()
    x, y, z = result.vertices.unbind(1)
    exact = (torch.hypot(torch.hypot(x, y) - 2.0, z) - 0.8).abs().max()
    torch.testing.assert_close(distance, exact)
    assert result.after["largest_distance"] == pytest.approx(float(exact))
    assert exact <= 0.0501 * result.before["mean_edge_length"]  # the distance limit
    assert all(promise.holds for promise in result.promises)
    # a mesh through the vertices is another surface, several times farther from the torus
    own = minimise_normal_variation(mesh.vertices, mesh.topology, settings=settings)
    x, y, z = own.vertices.unbind(1)
    assert (torch.hypot(torch.hypot(x, y) - 2.0, z) - 0.8).abs().max() > 2.0 * exact


@pytest.mark.slow
def test_finer_levels_stay_on_the_exact_sphere() -> None:
    mesh = icosphere(0)
    settings = FairSettings(closeness_weight=1e4, distance_limit=None, crease_angle=0.0, projection=QUICK)
    sphere = ClosestOnSurface(Sphere(1.0))
    result = minimise_normal_variation(mesh.vertices, mesh.topology, reference=sphere, settings=settings, levels=1)
    assert len(result.vertices) == 42
    assert (vector_norm(result.vertices, dim=1) - 1.0).abs().max() < 0.002


def test_height_functions_hold_a_patch() -> None:
    surface = Paraboloid(1.0, -0.5, (1.0, 1.0))
    mesh = irregular_triangles(surface, 80)
    reference = closest_on_height_field(lambda x, y: 0.5 * (x * x - 0.5 * y * y))
    settings = FairSettings(closeness_weight=1e4, projection=QUICK)
    result = minimise_normal_variation(
        noisy(mesh.vertices, 0.005), mesh.topology, reference=reference, settings=settings
    )
    inner = ~mesh.topology.is_boundary_vertex
    x, y, z = result.vertices[inner].unbind(1)
    start = noisy(mesh.vertices, 0.005)[inner]
    before = (start[:, 2] - 0.5 * (start[:, 0] ** 2 - 0.5 * start[:, 1] ** 2)).abs().max()
    assert (z - 0.5 * (x * x - 0.5 * y * y)).abs().max() < 0.2 * before
    assert result.after["normal_variation"] < result.before["normal_variation"]


def test_principal_symmetric_meshes_stay_near_the_exact_torus() -> None:
    surface = Torus(2.0, 0.8, tube_angles=(2.0, 4.3), angles=(0.0, 2.0))
    mesh = principal_triangles(surface, 8, 10)
    principal = principal_edges_of_lattice(mesh)
    start = noisy(mesh.vertices, 0.005)

    def away(vertices: Tensor) -> Tensor:
        x, y, z = vertices.unbind(1)
        return (torch.hypot(torch.hypot(x, y) - 2.0, z) - 0.8).abs().max()

    free = principal_symmetric(start, principal)
    held = principal_symmetric(
        start, principal, reference=ClosestOnSurface(surface), settings=SymmetricSettings(closeness_weight=100.0)
    )
    assert held.holds
    assert away(held.vertices) < 0.5 * away(free.vertices)


def test_what_is_no_surface_is_refused_before_the_start() -> None:
    mesh = icosphere(1)
    with pytest.raises(ShapeError, match="reference"):
        minimise_normal_variation(mesh.vertices, mesh.topology, reference=Sphere())  # type: ignore[arg-type]
    with pytest.raises(MeshError, match="not finite"):
        minimise_normal_variation(mesh.vertices, mesh.topology, reference=lambda p: (p, p / 0.0))
