"""Curvature fitted at some vertices and averaged over those between them."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import mixed_grid, with_isolated
from helpers import DOUBLE, random_rotation, wavy_grid

from torchfair import Topology
from torchfair.geometry import edge_lengths, fitted_curvature
from torchfair.geometry.sampled_curvature import sampled_curvature, spread_vertices
from torchfair.shapes import Catenoid, Torus, icosphere, irregular_triangles


def edges_apart(topology: Topology, most: int) -> torch.Tensor:
    """(V, V) whether two vertices are within so many edges, by powers of the matrix of neighbours."""
    near = torch.eye(topology.num_vertices, dtype=DOUBLE)
    v, w = topology.edges.unbind(1)
    near[v, w] = near[w, v] = 1.0
    return torch.linalg.matrix_power(near, most) > 0


@pytest.mark.parametrize(
    "topology",
    [
        icosphere(3).topology,
        mixed_grid()[1],
        wavy_grid(9, 7, triangles=True)[1],
        irregular_triangles(Torus(), 500).topology,
        Topology.from_faces([[0, 1, 2]], num_vertices=5),
    ],
    ids=["sphere", "mixed", "grid", "torus", "isolated"],
)
def test_set_is_even(topology: Topology) -> None:
    """None within two edges of another, and all within two edges of one."""
    chosen, near = spread_vertices(topology), edges_apart(topology, 2)
    assert near[chosen][:, chosen].equal(torch.eye(int(chosen.sum()), dtype=torch.bool))
    assert near[:, chosen].any(1).all()


def test_curvatures_between_fits_of_spheres_are_right_to_the_second_order() -> None:
    errors = []
    for level in (3, 4, 5):
        ball = icosphere(level, radius=2.0)
        errors.append(float((sampled_curvature(ball.vertices, ball.topology).curvatures - 0.5).abs().max()))
    assert errors[0] < 0.06
    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.5


@pytest.mark.parametrize(("noise", "most"), [(0.0, 1.3), (0.05, 2.0)])
@pytest.mark.parametrize("surface", [Torus(2.0, 0.8), Catenoid()], ids=["torus", "catenoid"])
def test_directions_are_nearly_as_good_as_those_of_fits_everywhere(surface, noise: float, most: float) -> None:
    """Median angle to the parallels of surfaces of revolution."""
    mesh = irregular_triangles(surface, 2500)
    generator = torch.Generator().manual_seed(3)
    shake = torch.randn(mesh.vertices.shape, generator=generator, dtype=DOUBLE)
    vertices = mesh.vertices + noise * float(edge_lengths(mesh.vertices, mesh.topology).mean()) * shake
    along = torch.stack([-vertices[:, 1], vertices[:, 0], torch.zeros(len(vertices))], 1)
    along = along / along.norm(dim=1, keepdim=True)
    full, fit = fitted_curvature(vertices, mesh.topology), sampled_curvature(vertices, mesh.topology)
    inner = ~mesh.topology.is_boundary_vertex & (full.confidence > 0.9)
    assert inner.double().mean() > 0.7
    cosines = (torch.linalg.vecdot(f.directions, along[:, None]).abs().amax(1).clamp(max=1.0) for f in (full, fit))
    everywhere, between = (float(torch.rad2deg(cosine[inner].acos()).median()) for cosine in cosines)
    assert between < everywhere + most
    assert fit.rings == full.rings
    assert float(fit.confidence[inner].mean()) > 0.85


def test_fields_turn_with_the_mesh() -> None:
    mesh, turn = irregular_triangles(Torus(), 600), random_rotation(5)
    here, there = (sampled_curvature(v, mesh.topology) for v in (mesh.vertices, mesh.vertices @ turn.T))
    assert torch.allclose(turn @ here.operators @ turn.T, there.operators, atol=1e-9)
    assert torch.allclose(here.confidence, there.confidence, atol=1e-7)


def test_isolated_vertices_have_no_directions() -> None:
    vertices, topology = with_isolated(wavy_grid(9, 7, triangles=True))
    fit = sampled_curvature(vertices, topology)
    isolated = torch.ones(topology.num_vertices, dtype=torch.bool)
    isolated[topology.corners] = False
    assert isolated.any()
    assert (fit.confidence[isolated] == 0).all()
    assert all(x.isfinite().all() for x in (fit.operators, fit.directions, fit.confidence, fit.curvatures))
