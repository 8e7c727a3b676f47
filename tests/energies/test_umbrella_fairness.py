from __future__ import annotations

import itertools
import math

import pytest
import torch
from geometry_meshes import GENERIC, torus
from helpers import DOUBLE, wavy_grid

from torchfair.energies import UmbrellaFairness, umbrella_fairness


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_equals_the_sum_over_interior_vertices_in_a_loop(mesh):
    vertices, topology = mesh()
    total = 0.0
    for v, ring in enumerate(topology.ring_vertices.split(topology.valences.tolist())):
        if not topology.is_boundary_vertex[v]:
            total += (vertices[ring].mean(0) - vertices[v]).square().sum().item()
    assert umbrella_fairness(vertices, topology).item() == pytest.approx(total)


def test_one_lifted_vertex_of_a_regular_grid():
    vertices, topology = wavy_grid(5, 5)
    vertices = vertices.round()
    assert umbrella_fairness(vertices, topology).item() == 0
    vertices[12, 2] = 2.0  # itself by 2, four neighbours by 2/4 each
    assert umbrella_fairness(vertices, topology).item() == pytest.approx(4 + 4 * 0.25)
    assert UmbrellaFairness(topology).per_vertex(vertices)[[12, 7, 0]].tolist() == [4.0, 0.25, 0.0]


def test_vanishes_with_second_order_under_refinement():
    values = [umbrella_fairness(*torus(n, n)).item() for n in (12, 24, 48)]
    assert all(1.8 < math.log2(coarse / fine) < 2.2 for coarse, fine in itertools.pairwise(values))


def test_least_value_with_fixed_boundary_solves_the_laplace_equation():
    """Interior vertices at the mean of their neighbours: the discrete harmonic surface, energy zero."""
    vertices, topology = wavy_grid(5, 5)
    inside = ~topology.is_boundary_vertex
    for _ in range(400):
        step = torch.zeros_like(vertices)
        for v in torch.nonzero(inside).flatten().tolist():
            ring = topology.ring_vertices[topology.ring_offsets[v] : topology.ring_offsets[v + 1]]
            step[v] = vertices[ring].mean(0) - vertices[v]
        vertices = vertices + step
        if step.abs().max() < 1e-12:
            break
    assert umbrella_fairness(vertices, topology).item() < 1e-20
    assert vertices.dtype == DOUBLE
