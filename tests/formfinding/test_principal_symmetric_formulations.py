"""Other variables and fewer conditions: principal-symmetric design by vertices alone, as printed, on one polyline."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE
from symmetric_starts import STARTS, largest, pulled, start

from torchfair.energies import normal_variation
from torchfair.formfinding import SymmetricDesign, SymmetricSettings, principal_symmetric
from torchfair.formfinding.symmetric.measures import condition_residuals
from torchfair.geometry import vertex_normals
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Catenoid, principal_triangles


@pytest.mark.parametrize("formulation", ["eliminated", "lifted"])
def test_other_formulations_meet_the_conditions_too(formulation: str) -> None:
    vertices, edges = start("torus")
    settings = SymmetricSettings(formulation=formulation)
    result = principal_symmetric(vertices, edges, handles=pulled(vertices, edges, 0.05), settings=settings)
    assert largest(result.vertices, edges) < 1e-6


def test_conditions_on_one_polyline_leave_the_rest_to_energy() -> None:
    mesh = STARTS["torus"]()
    edges = principal_edges_of_lattice(mesh)
    generator = torch.Generator().manual_seed(4)
    vertices = mesh.vertices + 0.03 * torch.randn(mesh.vertices.shape, generator=generator, dtype=DOUBLE)
    line = edges.polylines()[3]
    settings = SymmetricSettings(energy_weight=0.3)
    result = principal_symmetric(vertices, edges, on=line, settings=settings, levels=1)
    stars = edges.stars()
    chosen = torch.isin(stars.vertices, line)
    coarse = result.levels[0]
    residuals = condition_residuals(coarse.vertices, edges, stars)["cospherical"]
    assert float(residuals[chosen].max()) < 1e-8
    assert float(residuals[~chosen].max()) > 1e-4
    assert coarse.after["stars"] == len(torch.unique(line))
    assert coarse.after["normal_variation"] < coarse.before["normal_variation"]
    assert result.levels[1].after["stars"] == 2 * len(torch.unique(line))


@pytest.mark.slow
def test_energy_has_the_variables_of_the_paper_too() -> None:
    """3V + 3R + 3n + 2R of spheres, planes and slacks, and 3F + 4I of E, in the runs that lower it; E falls by it."""
    vertices, edges = start("torus")
    handles = pulled(vertices, edges, 0.05)
    energies = {}
    for weight in (0.0, 1.0):
        settings = SymmetricSettings(formulation="lifted", energy_weight=weight)
        result = principal_symmetric(vertices, edges, handles=handles, settings=settings)
        level, topology = result.levels[-1], edges.topology
        stars, planes = len(edges.stars().vertices), int(edges.mask.sum())
        count = 3 * topology.num_vertices + 3 * stars + 3 * planes + 2 * stars
        with_energy = count + 3 * topology.num_faces + 4 * topology.num_interior_edges
        sizes = [sum(block.numel() for block in run.blocks.values()) for run in level.runs]
        assert max(sizes) == (with_energy if weight else count)
        assert max(level.after["largest_cospherical"], level.after["largest_coplanar"]) < 1e-6
        energies[weight] = float(normal_variation(level.vertices, topology))
    assert energies[1.0] < energies[0.0]


def test_one_round_meets_conditions_and_saddle_sides_together() -> None:
    """Steps heed saddle sides while conditions are met; blind ones leave some stars beside the boundary wrong."""
    mesh = principal_triangles(Catenoid(1.0, (-1.0, 1.0)), 16, 30, along="v", ends="zigzag")
    edges = principal_edges_of_lattice(mesh, "v")
    vertices, stars = mesh.vertices, edges.stars().vertices
    handle = int(stars[len(stars) // 2])
    far = int((vertices - vertices[handle]).norm(dim=1).argmax())
    pull = 0.25 * float((vertices.amax(0) - vertices.amin(0)).norm())
    place = vertices[handle] + pull * vertex_normals(vertices, edges.topology)[handle]
    design = SymmetricDesign(vertices, edges, handles=[handle, far])
    handles = {handle: place.tolist(), far: vertices[far].tolist()}
    design.move(handles, rounds=1)
    measures = design.measures()
    assert max(measures["largest_cospherical"], measures["largest_coplanar"]) < 1e-9
    assert measures["saddle_side_share"] == 1.0
    assert measures["crossing_pyramids_negative"] == 0.0
    assert measures["largest_handle_distance"] < 0.05 * measures["mean_edge_length"]
