"""Spheres of stars: exact where there is one, even misses elsewhere, finite where the star is flat."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from principal_lattices import LATTICES

from torchfair.geometry import vertex_normals
from torchfair.principal import principal_edges_of_lattice, principal_normals, star_spheres
from torchfair.principal.spheres import spheres_through
from torchfair.shapes import Catenoid, Cylinder, Enneper, Paraboloid, Torus, principal_triangles
from torchfair.shapes.principal_triangles import parameter_triangles

SPOKES = torch.tensor([[0.5, 1.0], [-0.6, 0.9], [-0.5, -1.1], [0.4, -0.8]], dtype=DOUBLE)


def star_on_sphere(curvature: float) -> torch.Tensor:
    """(4, 3) neighbours of the origin on the sphere with this curvature that touches the plane z = 0 there."""
    squares = SPOKES.square().sum(1)
    heights = curvature * squares / (1.0 + (1.0 - curvature**2 * squares).sqrt())
    return torch.cat([SPOKES, heights[:, None]], dim=1)


@pytest.mark.parametrize("curvature", [0.7, -0.4, 1e-6, 0.0, -1e-9])
def test_a_sphere_through_all_neighbours_is_found(curvature: float) -> None:
    spheres = spheres_through(torch.zeros(1, 3, dtype=DOUBLE), star_on_sphere(curvature)[None])
    assert float(spheres.curvatures - curvature) == pytest.approx(0.0, abs=1e-14)
    torch.testing.assert_close(spheres.normals, torch.tensor([[0.0, 0.0, 1.0]], dtype=DOUBLE), rtol=0, atol=1e-14)
    assert float(spheres.misses.abs()) < 1e-14


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=50)
def test_neighbours_miss_it_alike_with_alternating_signs(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    centre = torch.randn(3, generator=generator, dtype=DOUBLE)
    spokes = star_on_sphere(0.3) + 0.2 * torch.randn(4, 3, generator=generator, dtype=DOUBLE)
    spheres = spheres_through(centre[None], (centre + spokes)[None])
    missed = spheres.curvatures * spokes.square().sum(1) - 2.0 * spokes @ spheres.normals[0]
    torch.testing.assert_close(missed, spheres.misses * torch.tensor([1.0, -1, 1, -1], dtype=DOUBLE))
    assert float(spheres.normals.norm()) == pytest.approx(1.0)
    half = 0.5 * spheres.misses.abs()
    if float(half) < 0.1:  # half the miss is the distance from the sphere
        centre_of_sphere = centre + spheres.normals[0] / spheres.curvatures
        away = ((centre + spokes - centre_of_sphere).norm(dim=1) - 1.0 / spheres.curvatures.abs()).abs()
        assert float((away - half).abs().max()) < 0.1 * float(half) + float(half.square())


def test_scale_and_motion() -> None:
    centre = torch.tensor([[0.1, 0.2, -0.3]], dtype=DOUBLE)
    ring = centre[:, None] + star_on_sphere(0.5) + 0.05 * torch.sin(torch.arange(12, dtype=DOUBLE)).view(4, 3)
    turn, before = random_rotation(3), spheres_through(centre, ring)
    after = spheres_through(3.0 * centre @ turn.T, 3.0 * ring @ turn.T)
    torch.testing.assert_close(after.normals, before.normals @ turn.T)
    torch.testing.assert_close(3.0 * after.curvatures, before.curvatures)
    torch.testing.assert_close(after.misses, 3.0 * before.misses)


def test_no_sphere_gives_zeros_and_finite_gradients() -> None:
    line = torch.tensor([[1.0, 0, 0], [2, 0, 0], [-1, 0, 0], [-2, 0, 0]], dtype=DOUBLE, requires_grad=True)
    for ring in (line, line * 0.0):
        spheres = spheres_through(torch.zeros(1, 3, dtype=DOUBLE), ring[None])
        for part in spheres:
            assert float(part.detach().abs().max()) == 0.0
        (gradient,) = torch.autograd.grad(sum(part.sum() for part in spheres), line)
        assert bool(torch.isfinite(gradient).all())


def test_gradcheck_at_curved_and_flat_stars_and_batches() -> None:
    ring = torch.stack([star_on_sphere(0.4), star_on_sphere(0.0)])[None].repeat(2, 1, 1, 1)
    ring = (ring + 0.03 * torch.cos(torch.arange(ring.numel(), dtype=DOUBLE)).view_as(ring)).requires_grad_()
    centre = torch.zeros(2, 2, 3, dtype=DOUBLE, requires_grad=True)
    assert torch.autograd.gradcheck(lambda c, r: tuple(spheres_through(c, r)), (centre, ring))


@pytest.mark.parametrize("surface", [Torus(2.0, 1.0), Catenoid(), Cylinder()])
def test_lattices_on_surfaces_of_revolution_are_exact(surface: object) -> None:
    mesh = principal_triangles(surface, 8, 12, along="u")  # type: ignore[arg-type]
    edges = principal_edges_of_lattice(mesh, "u")
    assert float(star_spheres(mesh.vertices, edges.stars()).misses.abs().max()) < 1e-13


def test_on_any_principal_lattice_misses_fall_with_the_square_of_the_spacing_at_least() -> None:
    misses = []
    for cells in (8, 16, 32):
        mesh = principal_triangles(Enneper(0.7), cells, cells)
        misses.append(float(star_spheres(mesh.vertices, principal_edges_of_lattice(mesh).stars()).misses.abs().max()))
    assert misses[0] / misses[1] > 4.0
    assert misses[1] / misses[2] > 4.0


def test_curvature_is_the_normal_curvature_of_the_spokes() -> None:
    a, b = 0.6, -0.9
    mesh = parameter_triangles(Paraboloid(a, b), 40, 40)
    edges = principal_edges_of_lattice(mesh, "u")
    stars = edges.stars()
    middle = int(mesh.vertices[stars.vertices].norm(dim=1).argmin())
    spoke = (mesh.vertices[stars.cospherical] - mesh.vertices[stars.vertices, None])[middle, 0]
    cosine2 = float(spoke[0] ** 2 / spoke[:2].square().sum())
    expected = a * cosine2 + b * (1.0 - cosine2)
    assert float(star_spheres(mesh.vertices, stars).curvatures[middle]) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", LATTICES)
def test_normals_are_unit_and_lie_in_the_planes_of_edges_to_stars(name: str) -> None:
    mesh, along = LATTICES[name]
    edges = principal_edges_of_lattice(mesh, along)
    stars = edges.stars()
    normals = principal_normals(mesh.vertices, edges)
    torch.testing.assert_close(normals.norm(dim=1), torch.ones(len(normals), dtype=DOUBLE))
    assert float((normals * vertex_normals(mesh.vertices, mesh.topology)).sum(1).min()) > 0.8
    torch.testing.assert_close(normals[stars.vertices], star_spheres(mesh.vertices, stars).normals)
    ends = edges.topology.edges[edges.mask]
    one = torch.isin(ends, stars.vertices).sum(1) == 1
    counts = torch.bincount(ends[one].flatten(), minlength=len(normals))
    once = (counts[ends[one]] == 1).any(1) & ~torch.isin(ends[one], stars.vertices).all(1)
    v, w = ends[one][once].unbind(1)
    if v.numel():
        planes = torch.linalg.cross(normals[v], normals[w])
        assert float((planes * (mesh.vertices[w] - mesh.vertices[v])).sum(1).abs().max()) < 1e-9
