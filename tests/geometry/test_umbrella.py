from __future__ import annotations

import pytest
import torch
from geometry_meshes import GENERIC, icosphere, mixed_grid, with_isolated
from helpers import DOUBLE, wavy_grid

from torchfair.geometry import umbrella_vectors


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
@pytest.mark.parametrize("include_boundary", [False, True])
def test_equals_the_mean_over_the_ring_in_a_loop(mesh, include_boundary):
    vertices, topology = mesh()
    rings = topology.ring_vertices.split(topology.valences.tolist())
    expected = torch.stack([vertices[ring].mean(0) - v for ring, v in zip(rings, vertices, strict=True)])
    if not include_boundary:
        expected[topology.is_boundary_vertex] = 0
    torch.testing.assert_close(umbrella_vectors(vertices, topology, include_boundary=include_boundary), expected)


def test_zero_in_a_regular_lattice_and_inward_on_a_sphere():
    vertices, topology = wavy_grid(5, 5)
    regular = vertices.round()
    assert not umbrella_vectors(regular, topology).any()
    sphere, closed = icosphere(2)
    assert ((umbrella_vectors(sphere, closed) * sphere).sum(-1) < 0).all()


def test_zero_at_isolated_vertices_even_with_the_boundary():
    vertices, topology = with_isolated(mixed_grid())
    umbrellas = umbrella_vectors(vertices, topology, include_boundary=True)
    assert not umbrellas[-1].any()
    assert umbrellas[:-1].any(-1).all()


def test_keeps_its_digits_far_from_the_origin():
    vertices, topology = mixed_grid()
    vertices = (vertices * 1024).round() / 1024
    far = umbrella_vectors(vertices + 2.0**20, topology)
    torch.testing.assert_close(far, umbrella_vectors(vertices, topology), rtol=1e-15, atol=1e-15)


def test_is_linear():
    first, topology = mixed_grid(0)
    second, _ = mixed_grid(1)
    parts = 2 * umbrella_vectors(first, topology) - 3 * umbrella_vectors(second, topology)
    torch.testing.assert_close(umbrella_vectors(2 * first - 3 * second, topology), parts)
    assert parts.dtype == DOUBLE
