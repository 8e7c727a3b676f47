"""Fits over wide patches along the boundary."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
import torch
from helpers import DOUBLE, random_rotation
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import FittedCurvature, Patches, edge_lengths, fitted_curvature
from torchfair.geometry import _rim_fits as rim_module
from torchfair.geometry._height_rows import terms
from torchfair.shapes import Catenoid, FreeFormPatch, Paraboloid, Surface, irregular_triangles


@dataclass(frozen=True)
class Graph(Surface):
    """Graph of a polynomial over a square that is turned against its principal directions."""

    cubic: float = 0.0

    domain = ((-1.0, 1.0), (-1.0, 1.0))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        x, y = 0.8 * u - 0.6 * v, 0.6 * u + 0.8 * v
        return torch.stack([x, y, 0.5 * x * x - 0.3 * y * y + self.cubic * (x**3 - 2 * x * y * y)], dim=-1)


def noisy(mesh, level: float, seed: int = 1) -> Tensor:
    size = level * edge_lengths(mesh.vertices, mesh.topology).mean()
    generator = torch.Generator().manual_seed(seed)
    return mesh.vertices + size * mesh.normals * torch.randn(len(mesh.vertices), 1, generator=generator).double()


def angles(found: Tensor, exact: Tensor) -> Tensor:
    x, y = ((found[..., 0, None, :] * exact).sum(-1)).abs().unbind(-1)
    return torch.rad2deg(torch.atan2(y, x))


def rim_of(patches: Patches) -> Tensor:
    return torch.cat([group.centres for group in patches.wide[len(patches.wide) - patches.num_rim_groups :]])


def without_rim(patches: Patches) -> Patches:
    """The same with wide patches fitted as those further inside are."""
    patches.num_rim_groups = 0
    return patches


def errors(mesh, fit: FittedCurvature) -> tuple[Tensor, Tensor]:
    exact = mesh.principal_curvatures
    return angles(fit.directions, mesh.principal_directions), (fit.curvatures - exact).abs().amax(-1)


@pytest.mark.parametrize(
    ("surface", "angle", "curvature"),
    [(FreeFormPatch(), 0.85, 0.9), (Catenoid(), None, 1.0), (Graph(), 1.0, 0.8)],
    ids=["free form", "catenoid", "saddle"],
)
def test_errors_at_the_rim_are_less_and_others_the_same(
    surface: Surface, angle: float | None, curvature: float
) -> None:
    """Against fits of degree four over the same patches; on the catenoid what these leave out turns no directions."""
    mesh = irregular_triangles(surface, 2400)
    vertices = torch.stack([noisy(mesh, 0.03, seed) for seed in (1, 2)])
    patches = Patches(mesh.topology, 6)
    rim = rim_of(patches)
    both = (patches, without_rim(Patches(mesh.topology, 6)))
    fits = [fitted_curvature(vertices, mesh.topology, rings=of) for of in both]
    (turned, curved), (turned_before, curved_before) = (errors(mesh, fit) for fit in fits)
    k1, k2 = mesh.principal_curvatures[rim].unbind(1)
    clear = rim[k1 - k2 > 0.1 * (k1.abs() + k2.abs())]
    if angle is not None:
        assert turned[:, clear].median() < angle * turned_before[:, clear].median()
    assert curved[:, rim].median() < curvature * curved_before[:, rim].median()
    others = torch.ones(len(mesh.vertices), dtype=torch.bool).index_fill(0, rim, False)
    assert torch.equal(fits[0].operators[:, others], fits[1].operators[:, others])
    assert torch.equal(fits[0].doubts[:, others], fits[1].doubts[:, others])


def test_doubts_are_no_less_than_errors() -> None:
    """Of the fixed directions in which errors are, over samples of the noise, root mean squares over the rim."""
    mesh = irregular_triangles(Graph(cubic=0.2), 1000)
    patches = Patches(mesh.topology, 4)
    rim = rim_of(patches)
    fit = fitted_curvature(torch.stack([noisy(mesh, 0.05, seed) for seed in range(8)]), mesh.topology, rings=patches)
    first, second = mesh.principal_directions[rim].unbind(1)
    half = (mesh.principal_curvatures[rim, 0] - mesh.principal_curvatures[rim, 1]) / 2
    along = (first * (fit.traceless[:, rim] @ first[..., None]).squeeze(-1)).sum(-1) - half
    across = (first * (fit.traceless[:, rim] @ second[..., None]).squeeze(-1)).sum(-1)
    error = ((along.square() + across.square()) / 2).mean().sqrt()
    doubt = fit.doubts[:, rim].square().mean().sqrt()
    assert 0.8 * error < doubt < 3.0 * error


@pytest.mark.parametrize("cubic", [0.0, 0.3])
def test_graphs_without_noise_are_exact(cubic: float) -> None:
    """In the plane of x and y the heights are polynomials of the third degree at most."""
    mesh = irregular_triangles(Graph(cubic=cubic), 1000)
    patches = Patches(mesh.topology, 3)
    rim = rim_of(patches)
    fit = fitted_curvature(mesh.vertices, mesh.topology, rings=patches)
    turned, curved = errors(mesh, fit)
    assert curved[rim].median() < 2e-3
    assert turned[rim].median() < 0.05


def test_moves_scales_turns_and_renumbers_with_the_mesh() -> None:
    mesh = irregular_triangles(FreeFormPatch(), 600)
    vertices, topology = noisy(mesh, 0.05), mesh.topology
    fit = fitted_curvature(vertices, topology, rings=3)
    rotation = random_rotation(2)
    moved = fitted_curvature(1e3 * vertices @ rotation.T + 10, topology, rings=3)
    torch.testing.assert_close(moved.operators * 1e3, rotation @ fit.operators @ rotation.T, rtol=1e-6, atol=1e-7)
    torch.testing.assert_close(moved.doubts * 1e3, fit.doubts, rtol=1e-6, atol=1e-9)
    order = torch.randperm(len(vertices), generator=torch.Generator().manual_seed(3))
    faces = torch.argsort(order)[topology.triangles]
    renumbered = fitted_curvature(vertices[order], Topology.from_faces(faces.flip(0).roll(1, 1)), rings=3)
    torch.testing.assert_close(renumbered.operators, fit.operators[order], rtol=1e-7, atol=1e-8)
    reverse = fitted_curvature(vertices, Topology.from_faces(topology.triangles.flip(1)), rings=3)
    torch.testing.assert_close(reverse.operators, -fit.operators, rtol=1e-7, atol=1e-8)


def test_connected_parts_know_nothing_of_each_other() -> None:
    meshes = [irregular_triangles(surface, 400) for surface in (FreeFormPatch(), Paraboloid(0.1, -0.2))]
    vertices = [noisy(mesh, 0.05) for mesh in meshes]
    count = len(vertices[0])
    faces = torch.cat([meshes[0].topology.triangles, meshes[1].topology.triangles + count])
    both = fitted_curvature(torch.cat(vertices), Topology.from_faces(faces), rings=3)
    for mesh, own, where in zip(meshes, vertices, (slice(0, count), slice(count, None)), strict=True):
        assert Patches(mesh.topology, 3).num_rim_groups
        alone = fitted_curvature(own, mesh.topology, rings=3)
        torch.testing.assert_close(both.operators[where], alone.operators, rtol=1e-8, atol=1e-9)


def test_batches_vmap_single_precision_and_derivatives() -> None:
    mesh = irregular_triangles(Graph(cubic=0.3), 300)
    patches = Patches(mesh.topology, 3)
    rim = rim_of(patches)[::10]
    batch = torch.stack([noisy(mesh, 0.05, seed) for seed in (1, 2)])

    def values(points: Tensor) -> Tensor:
        fit = fitted_curvature(points, mesh.topology, rings=patches)
        return torch.cat([fit.operators[..., rim, :, :].flatten(-3), fit.doubts[..., rim]], dim=-1)

    together = values(batch)
    torch.testing.assert_close(values(batch[1]), together[1])
    torch.testing.assert_close(torch.func.vmap(values)(batch), together)
    torch.testing.assert_close(values(batch.float()).double(), together, rtol=0, atol=5e-3)
    start = batch[0].clone().requires_grad_()
    assert torch.autograd.gradcheck(values, start, fast_mode=True)
    for flat in (mesh.vertices * 0, mesh.vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)):
        start = flat.clone().requires_grad_()
        found = values(start)
        assert found.isfinite().all()
        assert torch.autograd.grad(found.sum(), start)[0].isfinite().all()


def test_turned_terms_are_the_terms_of_turned_places() -> None:
    """Along the eigenvectors of the second derivatives, that of the smaller first, as heights are against normals."""
    generator = torch.Generator().manual_seed(5)
    listed = terms(6)
    values = torch.randn(4, len(listed), generator=generator, dtype=DOUBLE)
    x, y = torch.randn(2, 9, generator=generator, dtype=DOUBLE)
    turns = rim_module._turns(values)
    at = {term: values[:, listed.index(term)] for term in listed}
    for number in range(4):
        xx, xy, yy = (float(at[2, k][number]) for k in range(3))
        second, vectors = torch.linalg.eigh(torch.tensor([[2 * xx, xy], [xy, 2 * yy]], dtype=DOUBLE))
        found = turns[number] @ torch.stack([x ** (order - k) * y**k for order, k in listed])
        along, across = (vectors[0, i] * x + vectors[1, i] * y for i in range(2))
        for row, (order, k) in zip(found, listed, strict=True):
            torch.testing.assert_close(row.abs(), (along ** (order - k) * across**k).abs())
    assert second[0] < second[1]
