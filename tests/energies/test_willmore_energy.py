from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import GENERIC, Mesh
from helpers import DOUBLE, cube, wavy_grid

from torchfair import Topology, TorchfairError
from torchfair.energies import (
    WillmoreEnergy,
    willmore_energy,
    willmore_energy_per_vertex,
)
from torchfair.geometry import angle_defects, principal_values, vertex_areas
from torchfair.shapes import (
    Catenoid,
    Cylinder,
    Torus,
    icosphere,
    irregular_triangles,
    parameter_triangles,
    principal_quads,
    rotated_lattice,
)

DENSITIES = {
    "mean": lambda k: (k.sum(-1) / 2).square(),
    "difference": lambda k: (k[..., 0] - k[..., 1]).square(),
    "bending": lambda k: k.square().sum(-1),
}
ESTIMATORS = ["normal_cycle", "corrected"]
each_density = pytest.mark.parametrize("density", DENSITIES)
each_estimator = pytest.mark.parametrize("estimator", ESTIMATORS)


@each_density
@each_estimator
@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_square_of_the_principal_values_over_areas(mesh, estimator, density):
    vertices, topology = mesh()
    values = principal_values(vertices, topology, estimator=estimator)
    expected = DENSITIES[density](values) / vertex_areas(vertices, topology)
    terms = willmore_energy_per_vertex(vertices, topology, density=density, estimator=estimator)
    torch.testing.assert_close(terms, expected)


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_densities_are_related_star_by_star(mesh):
    """k1^2 + k2^2 is half the square of the difference and twice that of the mean."""
    mean, difference, bending = (willmore_energy_per_vertex(*mesh(), density=kind) for kind in DENSITIES)
    torch.testing.assert_close(bending, difference / 2 + 2 * mean)


@each_estimator
def test_four_pi_on_spheres_of_any_size_with_second_order(estimator):
    errors = {kind: [] for kind in DENSITIES}
    exact = {"mean": 4 * math.pi, "difference": 0.0, "bending": 8 * math.pi}
    for level in (3, 4):
        mesh = icosphere(level)
        for kind in DENSITIES:
            value = willmore_energy(7.0 * mesh.vertices, mesh.topology, density=kind, estimator=estimator).item()
            errors[kind].append(abs(value - exact[kind]))
    for kind in ("mean", "bending"):
        assert errors[kind][1] < 0.01 * exact[kind]
        assert math.log2(errors[kind][0] / errors[kind][1]) == pytest.approx(2, abs=0.1)
    assert errors["difference"][1] < 0.004
    assert errors["difference"][1] < 0.7 * errors["difference"][0]  # it is tiny where normals are corrected


@each_density
@each_estimator
@pytest.mark.parametrize("make", [parameter_triangles, lambda *size: rotated_lattice(*size, 0.3)])
def test_second_order_on_the_torus(make, estimator, density):
    big, small = 2.0, 0.8
    exact = math.pi**2 * big**2 / (small * math.sqrt(big**2 - small**2)) * (1 if density == "mean" else 4)
    errors = []
    for n in (24, 48):
        mesh = make(Torus(big, small), n, 2 * n)
        value = willmore_energy(mesh.vertices, mesh.topology, density=density, estimator=estimator).item()
        errors.append((value - exact) * mesh.topology.num_faces)  # times the inverse square of the edge length
    assert abs(errors[1]) / mesh.topology.num_faces < 0.02 * exact
    assert errors[1] == pytest.approx(errors[0], rel=0.06)


@each_density
@each_estimator
def test_cylinder_up_to_its_open_boundary(estimator, density):
    radius, height = 1.5, 2.0
    exact = math.pi * height / (2 * radius) * (1 if density == "mean" else 4)
    mesh = principal_quads(Cylinder(radius, height), 20, 80)
    module = WillmoreEnergy(mesh.topology, density=density, estimator=estimator, boundary="extrapolated")
    assert module(mesh.vertices).item() == pytest.approx(exact, rel=3e-3)


def test_minimal_surfaces_have_none_but_bend():
    """On a catenoid k1 = -k2: W by differences is 4 times the area integral of -K, half of that by bending."""
    low, high = -1.0, 1.0
    total = 2 * math.pi * (math.tanh(high) - math.tanh(low))  # of |K|
    mesh = principal_quads(Catenoid(1.0, (low, high)), 48, 144)
    exact = {"mean": 0.0, "difference": 4 * total, "bending": 2 * total}
    for density, value in exact.items():
        found = willmore_energy(mesh.vertices, mesh.topology, density=density, boundary="extrapolated").item()
        assert found == pytest.approx(value, abs=0.01 * total)


def test_differs_from_bending_by_the_total_gaussian_curvature():
    """On a closed surface the sum of angle defects does not depend on its shape: 4 pi here."""
    mesh = icosphere(4)
    stretched = mesh.vertices * torch.tensor([1.0, 1.2, 0.8], dtype=DOUBLE)
    mean, difference, bending = (willmore_energy(stretched, mesh.topology, density=kind).item() for kind in DENSITIES)
    gaussian = angle_defects(stretched, mesh.topology).sum().item()
    assert gaussian == pytest.approx(4 * math.pi)
    assert difference == pytest.approx(4 * mean - 4 * gaussian, abs=0.02 * gaussian)
    assert bending == pytest.approx(4 * mean - 2 * gaussian, abs=0.02 * gaussian)
    assert mean > 4 * math.pi  # Willmore: spheres have the least


def test_noise_is_squared_on_irregular_meshes():
    """By the normal cycle W ends too high, by differences more than by means; by corrected operators it converges."""
    exact = 4 * math.pi**2 / (0.8 * math.sqrt(4 - 0.64))
    meshes = [irregular_triangles(Torus(2.0, 0.8), count) for count in (2400, 9600)]

    def errors(estimator, density="mean"):
        scale = exact * (1 if density == "mean" else 4)
        values = [willmore_energy(m.vertices, m.topology, density=density, estimator=estimator).item() for m in meshes]
        return [value / scale - 1 for value in values]

    assert 0.01 < errors("normal_cycle")[1] < 0.02
    assert 0.035 < errors("normal_cycle", "difference")[1] < 0.05
    for density in ("mean", "difference"):
        coarse, fine = errors("corrected", density)
        assert math.log2(coarse / fine) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize(("boundary", "order", "largest"), [("open", 1, 0.04), ("extrapolated", 2, 2e-4)])
def test_open_boundaries_of_triangles_cost_the_normal_cycle_an_order(boundary, order, largest):
    errors = []
    for rows in (10, 20):
        mesh = parameter_triangles(Cylinder(1.0, 1.0), rows, 6 * rows)
        value = willmore_energy(mesh.vertices, mesh.topology, boundary=boundary).item()
        errors.append(abs(value / (math.pi / 2) - 1))
    assert errors[1] < largest
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.5)


def test_flat_meshes_are_no_kink():
    vertices, topology = wavy_grid(6, 6, triangles=True)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    assert willmore_energy(flat, topology).item() == 0.0
    for density in DENSITIES:
        gradient, hessian = (
            f(lambda v, d=density: willmore_energy(v, topology, density=d))(flat)
            for f in (torch.func.grad, torch.func.hessian)
        )
        assert not gradient.any()
        assert hessian.isfinite().all()
        assert hessian.abs().max() > 0.1
        up = torch.zeros_like(flat)
        up[14, 2] = 1.0
        step = willmore_energy(flat + 1e-4 * up, topology, density=density).item()
        assert step == pytest.approx(1e-8 / 2 * torch.einsum("ij,ijkl,kl", up, hessian, up).item(), rel=1e-5)


def test_cube() -> None:
    assert willmore_energy(*cube()).item() == pytest.approx(8 * 0.5**2 / 0.75)
    assert willmore_energy(*cube(), density="difference").item() == pytest.approx(0, abs=1e-12)


def test_stars_without_area_contribute_nothing():
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2]], 4)
    assert not willmore_energy_per_vertex(line, topology).any()


@pytest.mark.parametrize("make", [willmore_energy, WillmoreEnergy])
def test_refuses_unknown_densities(make):
    vertices, topology = cube()
    arguments = (vertices, topology) if make is willmore_energy else (topology,)
    with pytest.raises(TorchfairError, match=r"density must be one of \('mean'"):
        make(*arguments, density="gauss")


def test_says_what_it_measures() -> None:
    mesh: Mesh = cube()
    assert repr(WillmoreEnergy(mesh[1], density="bending")).endswith("open boundary, bending)")
