"""The surfaces of least bending that experiments compare with minimise what the library calls Willmore energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import pytest
import torch

from torchfair.constraints import absolute_curvature_terms
from torchfair.constraints.absolute_curvature import closed_star, open_star
from torchfair.energies import willmore_energy_per_vertex
from torchfair.shapes import Cylinder, parameter_triangles


def test_terms_of_least_bending_are_those_of_the_willmore_energy(script: Callable[[str], ModuleType]) -> None:
    forms = script("_forms")
    mesh = parameter_triangles(Cylinder(1.0, 2.0), 12, 36)
    bends = {closed_star: forms._closed_bend, open_star: forms._open_bend}
    total = torch.zeros((), dtype=torch.float64)
    for star in absolute_curvature_terms(mesh.topology, smoothing=1.0):
        ((_, stencil),) = star.stencil
        residuals = torch.func.vmap(bends[star.residual])(mesh.vertices[stencil])
        total = total + residuals.square().sum()
    expected = willmore_energy_per_vertex(mesh.vertices, mesh.topology, density="bending").sum().item()
    assert total.item() == pytest.approx(expected, rel=0.01)
    assert expected == pytest.approx(2 * math.pi * 2.0, rel=0.03)


def test_least_bending_lies_below_the_start(script: Callable[[str], ModuleType]) -> None:
    forms = script("_forms")
    mesh = parameter_triangles(Cylinder(1.0, 1.0), 8, 24)
    inner = ~mesh.topology.is_boundary_vertex
    bulge = 1.0 + 0.3 * (math.pi * mesh.vertices[:, 2:]).sin()
    start = torch.where(
        inner[:, None], mesh.vertices * torch.cat([bulge, bulge, torch.ones_like(bulge)], 1), mesh.vertices
    )
    found = forms.least_bending(start, mesh.topology, 20)
    before, after = (forms.figures(vertices, mesh.topology) for vertices in (start, found))
    assert after["squared_curvature"] < 0.9 * before["squared_curvature"]
