"""Total absolute curvature of meshes of surfaces in closed form: errors and observed orders."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import pytest

from torchfair.energies import total_absolute_curvature
from torchfair.shapes import (
    Catenoid,
    Cone,
    Cylinder,
    Enneper,
    Helicoid,
    ShapeMesh,
    Surface,
    Torus,
    icosphere,
    irregular_triangles,
    parameter_quads,
    parameter_triangles,
    rotated_lattice,
)

Make = Callable[[int], ShapeMesh]
RING = Torus(2.0, 0.8)
normal_cycle = partial(total_absolute_curvature, estimator="normal_cycle")
with_angles = partial(total_absolute_curvature, sine=False)
corrected = partial(total_absolute_curvature, estimator="corrected")
completed = partial(total_absolute_curvature, boundary="extrapolated")
METHODS = {"sine": normal_cycle, "angle": with_angles, "corrected": corrected}
each_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS.keys())


def errors(method: Callable, make: Make, sizes: tuple[int, ...] = (2, 4)) -> list[tuple[int, float]]:
    """Numbers of faces and relative errors of C, on finer and finer meshes."""
    found = []
    for size in sizes:
        mesh = make(size)
        value = method(mesh.vertices, mesh.topology).item()
        found.append((mesh.topology.num_faces, value / mesh.surface.total_absolute_curvature() - 1))
    return found


def order(found: list[tuple[int, float]]) -> float:
    """In the edge length, which is the inverse root of the number of faces."""
    (few, coarse), (many, fine) = found[-2:]
    return 2 * math.log(abs(coarse / fine)) / math.log(many / few)


# ---- closed surfaces -----------------------------------------------------------------------------------

CLOSED = {
    "sphere": lambda n: icosphere({3: 2, 6: 3}[n], 1.3),
    "torus, triangles": lambda n: parameter_triangles(RING, 8 * n, 16 * n),
    "torus, quads": lambda n: parameter_quads(RING, 8 * n, 16 * n),
    "torus, askew": lambda n: rotated_lattice(RING, 8 * n, 16 * n, 0.3),
}


@each_method
@pytest.mark.parametrize("make", CLOSED.values(), ids=CLOSED.keys())
def test_second_order_on_closed_lattices(method, make):
    """8 pi R on the sphere, 4 pi^2 R + 8 pi r on the torus."""
    found = errors(method, make, (3, 6))
    assert abs(found[-1][1]) < 0.02
    assert order(found) > 1.9


def test_angles_are_the_better_choice_on_closed_lattices():
    for make in CLOSED.values():
        assert abs(errors(with_angles, make, (3,))[0][1]) < 0.9 * abs(errors(normal_cycle, make, (3,))[0][1])


# ---- patches -------------------------------------------------------------------------------------------

ROUND = {"cylinder": Cylinder(1.0, 2.0), "cone": Cone(1.0, 0.4, 1.5), "catenoid": Catenoid()}
SQUARE = {"enneper": Enneper(), "helicoid": Helicoid()}
GRIDS = {"quads": parameter_quads, "triangles": parameter_triangles}


def lattice(make: Callable, surface: Surface, rows: int, columns: int) -> Make:
    return lambda n: make(surface, rows * n, columns * n)


PATCHES = {f"{name}, {kind}": lattice(make, s, 4, 9) for name, s in ROUND.items() for kind, make in GRIDS.items()}
PATCHES |= {f"{name}, quads": lattice(parameter_quads, s, 6, 6) for name, s in SQUARE.items()}
# Half triangles close the lattice along two sides, so the rows beside them are not like the others.
UNEVEN = {f"{name}, triangles": lattice(parameter_triangles, s, 6, 6) for name, s in SQUARE.items()}


@pytest.mark.parametrize("make", PATCHES.values(), ids=PATCHES.keys())
def test_extrapolated_boundaries_have_second_order(make):
    """Cylinder and cone 2 pi h, catenoid 4 pi h, Enneper 16 extent^2, helicoid 2 pitch du dv."""
    found = errors(completed, make, (4, 8))
    assert abs(found[-1][1]) < 0.003
    assert order(found) > 1.7 or abs(found[-1][1]) < 2e-4


@pytest.mark.parametrize("make", [*PATCHES.values(), *UNEVEN.values()], ids=[*PATCHES, *UNEVEN])
def test_the_corrected_estimator_needs_no_extrapolation(make):
    found = errors(corrected, make)
    assert abs(found[-1][1]) < 0.015
    assert order(found) > 1.85


@pytest.mark.parametrize("name", ["cylinder, triangles", "catenoid, quads", "enneper, quads", "helicoid, quads"])
def test_open_boundaries_cost_the_normal_cycle_a_term_of_first_order(name):
    found = errors(normal_cycle, PATCHES[name], (4, 8))
    assert 0.8 < order(found) < 1.4
    assert abs(found[-1][1]) > 4 * abs(errors(completed, PATCHES[name], (8,))[0][1])


def test_staggered_cones_are_high_because_of_their_boundary():
    """Flat triangles make it worse: the boundary is a larger part of them."""
    cone = Cone(1.0, 0.4, 1.5)
    mesh = parameter_triangles(cone, 24, 40)
    exact = 2 * math.pi * 1.5
    assert 1.03 < normal_cycle(mesh.vertices, mesh.topology).item() / exact < 1.05
    assert completed(mesh.vertices, mesh.topology).item() == pytest.approx(exact, rel=2e-3)
    assert corrected(mesh.vertices, mesh.topology).item() == pytest.approx(exact, rel=4e-3)


# ---- irregular meshes ----------------------------------------------------------------------------------

SMOOTH = {"torus": RING, "catenoid": Catenoid(), "enneper": Enneper(), "helicoid": Helicoid()}


@pytest.mark.parametrize("surface", SMOOTH.values(), ids=SMOOTH.keys())
def test_the_corrected_estimator_converges_on_irregular_meshes(surface):
    found = errors(corrected, lambda n: irregular_triangles(surface, 100 * n * n), (2, 3))
    assert abs(found[-1][1]) < 0.04
    assert order(found) > 1.5


@pytest.mark.parametrize("surface", [Cylinder(1.0, 2.0), Cone(1.0, 0.4, 1.5)], ids=["cylinder", "cone"])
def test_developable_surfaces_keep_an_offset_on_irregular_meshes(surface):
    """The curvature that should be zero is noise, and its size counts: a tenth of C by the normal cycle."""
    mesh = irregular_triangles(surface, 900)
    exact = surface.total_absolute_curvature()
    assert 1.05 < completed(mesh.vertices, mesh.topology).item() / exact < 1.15
    assert corrected(mesh.vertices, mesh.topology).item() == pytest.approx(exact, rel=0.015)
