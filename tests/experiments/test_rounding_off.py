"""A mesh rounded off has C about E', and that is not C of the surface it approximates (paper section 4)."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair.geometry import edge_lengths
from torchfair.shapes import Paraboloid

Run = Callable[..., dict[str, Any]]


def test_rounded_meshes_tend_to_the_energy_and_averaged_ones_to_the_surface(run: Run) -> None:
    report = run("rounding_off", "--rows", "10", "--radii", "1.5", "0.25", "0.06")
    saddle, bowl = report["saddle"]["layouts"], report["bowl"]["layouts"]
    for layouts in (saddle, bowl):
        for row in layouts.values():
            assert row["rounded_over_energy"][-1] == pytest.approx(1, abs=0.04)
            assert row["rounded_over_surface"][0] == pytest.approx(1, abs=0.02)
            assert row["normal_variation"] == pytest.approx(row["angle_variation"], rel=2e-3)
    gaps = [abs(value - 1) for value in saddle["irregular"]["rounded_over_energy"]]
    assert gaps == sorted(gaps, reverse=True)
    assert saddle["irregular"]["energy_over_surface"] > 1.25
    assert saddle["principal quads, cut"]["energy_over_surface"] < 1.1


@pytest.mark.parametrize("slope", [0.1, 1.0])
def test_an_edge_becomes_a_cylinder_with_its_angle(script: Callable[[str], ModuleType], slope: float) -> None:
    module = script("rounding_off")
    samples, count = 8, 60
    spacing = 1.0 / count
    grid = -0.5 + spacing * (np.arange(count + 2 * samples) - samples + 0.5)
    ridge = -slope * np.abs(grid)[:, None] * np.ones(len(grid))
    found = module.curvature_of_graph(ridge, samples, spacing)
    assert found == pytest.approx(2 * math.atan(slope), rel=2e-3)  # an edge of length 1
    assert module.curvature_of_graph(ridge.T.copy(), samples, spacing) == pytest.approx(found)


def test_quadratic_graphs_keep_their_curvature(script: Callable[[str], ModuleType]) -> None:
    module = script("rounding_off")
    samples, count = 6, 100
    spacing = 1.0 / count
    grid = -0.5 + spacing * (np.arange(count + 2 * samples) - samples + 0.5)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    exact = Paraboloid(0.8, -0.5, (0.5, 0.5)).total_absolute_curvature()
    assert module.curvature_of_graph(0.4 * x * x - 0.25 * y * y, samples, spacing) == pytest.approx(exact, rel=1e-3)


def test_edges_are_cut_at_the_window(script: Callable[[str], ModuleType]) -> None:
    module = script("rounding_off")
    vertices, topology = wavy_grid(5, 5, triangles=True)
    vertices = 0.4 * (vertices - 2.0)
    lengths = module.in_window(vertices, topology)
    share = torch.linspace(0, 1, 20001, dtype=DOUBLE)[:, None, None]
    start, stop = vertices[topology.interior_edges].unbind(1)
    inside = (torch.lerp(start, stop, share)[..., :2].abs() <= 0.5).all(-1).to(DOUBLE).mean(0)
    whole = edge_lengths(vertices, topology)[: topology.num_interior_edges]
    torch.testing.assert_close(lengths, inside * whole, atol=2e-4, rtol=0)
    assert int(((lengths > 0) & (lengths < 0.999 * whole)).sum()) > 0
