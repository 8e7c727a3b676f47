from __future__ import annotations

import pytest
import torch
from geometry_meshes import GENERIC, torus
from helpers import DOUBLE, cube, wavy_grid
from mesh_shelf import SHELF

from torchfair import Topology
from torchfair.energies import boundary_extrapolation
from torchfair.geometry import vertex_areas

TOPOLOGIES = {name: Topology.from_faces(faces) for name, faces in SHELF.items()}


def slow(topology: Topology, density: torch.Tensor) -> torch.Tensor:
    """Rounds over all vertices, each taking the mean of the neighbours known so far."""
    rings = [ring.tolist() for ring in topology.ring_vertices.split(topology.valences.tolist())]
    known = {v: density[v] for v in range(topology.num_vertices) if not topology.is_boundary_vertex[v]}
    while True:
        fresh = {}
        for v, ring in enumerate(rings):
            near = [known[w] for w in ring if w in known]
            if v not in known and near:
                fresh[v] = torch.stack(near).mean()
        if not fresh:
            return torch.stack([known.get(v, density[v]) for v in range(topology.num_vertices)])
        known |= fresh


@pytest.mark.parametrize("topology", TOPOLOGIES.values(), ids=TOPOLOGIES.keys())
def test_equals_rounds_over_the_vertices(topology):
    random = torch.Generator().manual_seed(1)
    density, areas = 0.5 + torch.rand(2, topology.num_vertices, dtype=DOUBLE, generator=random)
    found = boundary_extrapolation(topology).apply(density * areas, areas)
    torch.testing.assert_close(found, slow(topology, density) * areas)


@pytest.mark.parametrize("topology", TOPOLOGIES.values(), ids=TOPOLOGIES.keys())
def test_constant_densities_stay(topology):
    areas = torch.linspace(1, 2, topology.num_vertices, dtype=DOUBLE)
    torch.testing.assert_close(boundary_extrapolation(topology).apply(3 * areas, areas), 3 * areas)
    tables = boundary_extrapolation(topology)
    totals = torch.zeros(topology.num_vertices, dtype=DOUBLE).index_add(0, tables.targets, tables.weights)
    torch.testing.assert_close(totals, tables.replaced.to(DOUBLE))


def test_corners_take_from_the_boundary_in_a_second_round():
    topology = wavy_grid(4, 4)[1]
    tables = boundary_extrapolation(topology)
    taken = tables.sources[tables.targets == 0]
    assert taken.unique().tolist() == [5]  # a corner, through its two neighbours, from the one vertex inside
    assert tables.weights[tables.targets == 0].sum().item() == pytest.approx(1)


@pytest.mark.parametrize("topology", [cube()[1], torus()[1], Topology.from_faces([], 3)])
def test_nothing_to_do_without_a_boundary(topology):
    assert not boundary_extrapolation(topology).replaced.any()


def test_strips_keep_what_they_have():
    topology = wavy_grid(2, 6)[1]
    values = torch.arange(12, dtype=DOUBLE)
    areas = torch.ones(12, dtype=DOUBLE)
    assert not boundary_extrapolation(topology).replaced.any()
    torch.testing.assert_close(boundary_extrapolation(topology).apply(values, areas), values)


def test_without_area_there_is_no_density():
    topology = wavy_grid(4, 4)[1]
    values, areas = torch.ones(16, dtype=DOUBLE), torch.zeros(16, dtype=DOUBLE)
    found = boundary_extrapolation(topology).apply(values, areas)
    assert found.isfinite().all()


def test_works_inside_transforms_and_in_single_precision():
    vertices, topology = GENERIC["mixed"]()

    def total(points: torch.Tensor) -> torch.Tensor:
        areas = vertex_areas(points, topology)
        return boundary_extrapolation(topology).apply(areas.square(), areas).sum()

    assert torch.func.grad(total)(vertices).isfinite().all()
    assert total(vertices.float()).dtype == torch.float32
