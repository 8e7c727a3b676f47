"""Fine meshes, all of whose edges are nearly flat: what counts as flat falls with them."""

from __future__ import annotations

import pytest
import torch
from helpers import wavy_grid

from torchfair.energies import normal_variation, normal_variation_per_edge
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.fair import problem
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job.pulls import Pulls
from torchfair.geometry import edge_lengths
from torchfair.shapes import PrincipalParaboloid, Torus, icosphere, irregular_triangles


def sharpness(vertices: torch.Tensor, topology: object) -> float:
    """Of a mesh in its mean edge length."""
    vertices = vertices / edge_lengths(vertices, topology).mean()
    return FairProblem(vertices, topology, None, Pulls(vertices), FairSettings()).sharpness


def test_coarse_meshes_are_left_alone_and_fine_ones_fall_in_proportion() -> None:
    mesh = irregular_triangles(Torus(), 150)
    assert sharpness(mesh.vertices, mesh.topology) == 1.0
    found = []
    for level in (4, 5):
        fine = icosphere(level)
        scaled = fine.vertices / edge_lengths(fine.vertices, fine.topology).mean()
        mean = float(normal_variation_per_edge(scaled, fine.topology).mean())
        found.append(sharpness(fine.vertices, fine.topology))
        assert found[-1] == pytest.approx(min(1.0, mean / 0.05), rel=1e-12)
        assert sharpness(1e-6 * fine.vertices, fine.topology) == pytest.approx(found[-1], rel=1e-9)
    assert found[1] == pytest.approx(0.5 * found[0], rel=0.02)  # l* is halved


def test_flat_meshes_keep_some_smoothing() -> None:
    vertices, topology = wavy_grid(5, 4)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=vertices.dtype)
    assert sharpness(flat, topology) == 0.01


def test_it_lowers_the_energy_of_a_shallow_saddle(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = irregular_triangles(PrincipalParaboloid(0.12, -0.08), 250)

    def reached() -> float:
        job = minimise_normal_variation(mesh.vertices, mesh.topology)
        assert all(promise.holds for promise in job.promises)
        return float(normal_variation(job.vertices, mesh.topology))

    sharp = reached()
    monkeypatch.setattr(problem, "_USUAL", 1e-9)
    assert sharp < 0.99 * reached()
