from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import GENERIC
from helpers import cube

from torchfair.energies import (
    total_absolute_curvature,
    total_frobenius_curvature,
    total_frobenius_curvature_per_vertex,
)
from torchfair.geometry import principal_values
from torchfair.shapes import (
    Catenoid,
    Cylinder,
    Torus,
    icosphere,
    parameter_triangles,
    principal_quads,
    rotated_lattice,
)

ESTIMATORS = ["normal_cycle", "corrected"]
each_estimator = pytest.mark.parametrize("estimator", ESTIMATORS)


@each_estimator
@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_root_of_the_squared_principal_values(mesh, estimator):
    vertices, topology = mesh()
    expected = principal_values(vertices, topology, estimator=estimator).square().sum(-1).sqrt()
    torch.testing.assert_close(total_frobenius_curvature_per_vertex(vertices, topology, estimator=estimator), expected)


@each_estimator
@pytest.mark.parametrize(
    ("mesh", "factor"),
    [
        (icosphere(3), math.sqrt(0.5)),
        (principal_quads(Catenoid(), 20, 60), math.sqrt(0.5)),
        (principal_quads(Cylinder(), 10, 40), 1.0),
    ],
    ids=["sphere", "minimal surface", "cylinder"],
)
def test_known_ratios_to_total_absolute_curvature(mesh, factor, estimator):
    c2, c = (
        f(mesh.vertices, mesh.topology, estimator=estimator, boundary="extrapolated")
        for f in (total_frobenius_curvature, total_absolute_curvature)
    )
    assert (c2 / c).item() == pytest.approx(factor, rel=5e-3)


@each_estimator
@pytest.mark.parametrize("make", [parameter_triangles, lambda *size: rotated_lattice(*size, 0.3)])
def test_second_order_on_the_torus(make, estimator):
    surface = Torus(2.0, 0.8)
    exact = surface.integrate(lambda u, v: surface.principal_curvatures(u, v).square().sum(-1).sqrt())
    errors = []
    for n in (24, 48):
        mesh = make(surface, n, 2 * n)
        value = total_frobenius_curvature(mesh.vertices, mesh.topology, estimator=estimator).item()
        errors.append((value - exact) * mesh.topology.num_faces)  # times the inverse square of the edge length
    assert errors[1] == pytest.approx(errors[0], rel=0.05)


def test_cube():
    assert total_frobenius_curvature(*cube()).item() == pytest.approx(8 * math.sqrt(2) / 2)
