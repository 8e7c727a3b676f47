from __future__ import annotations

import itertools
import math

import pytest
import torch
from geometry_meshes import DEGENERATE, capped_prism
from helpers import cube, tetrahedron

from torchfair.geometry import balanced_normals, edge_vectors, vertex_normals
from torchfair.shapes import (
    Catenoid,
    Enneper,
    Helicoid,
    Sphere,
    Torus,
    irregular_triangles,
    parameter_quads,
    parameter_triangles,
    rotated_lattice,
)

OPEN = {"catenoid": Catenoid(), "enneper": Enneper(), "helicoid": Helicoid(), "cap": Sphere(1.0, (-0.9, 0.9))}
LATTICES = {
    "triangles": lambda surface, n: parameter_triangles(surface, 6 * n, 10 * n),
    "quads": lambda surface, n: parameter_quads(surface, 6 * n, 10 * n),
    "rotated": lambda surface, n: rotated_lattice(surface, 6 * n, 10 * n, 0.3),
}


def errors(mesh, normals: torch.Tensor) -> torch.Tensor:
    return torch.linalg.vector_norm(normals - mesh.normals, dim=-1)


def boundary_errors(function, surface, lattice) -> list[float]:
    """Root mean square over the boundary vertices of two meshes, the second twice as fine."""
    found = []
    for n in (2, 4):
        mesh = LATTICES[lattice](surface, n)
        size = errors(mesh, function(mesh.vertices, mesh.topology))[mesh.topology.is_boundary_vertex]
        found.append(size.square().mean().sqrt().item())
    return found


@pytest.mark.parametrize("surface", OPEN.values(), ids=OPEN.keys())
@pytest.mark.parametrize("lattice", LATTICES.keys())
def test_boundary_normals_are_several_times_better_than_means_of_faces(surface, lattice):
    found, plain = (boundary_errors(f, surface, lattice) for f in (balanced_normals, vertex_normals))
    assert math.log2(plain[0] / plain[1]) < 1.2  # first order
    assert all(ours < means / 3 for ours, means in zip(found, plain, strict=True))


@pytest.mark.parametrize(
    ("name", "lattice"),
    [*((name, "quads") for name in OPEN), ("catenoid", "triangles"), ("cap", "triangles")],
)
def test_second_order_on_the_boundary_of_regular_lattices(name, lattice):
    coarse, fine = boundary_errors(balanced_normals, OPEN[name], lattice)
    assert math.log2(coarse / fine) > 1.6


def test_irregular_meshes_gain_by_sweeps():
    mesh = irregular_triangles(Torus(2.0, 0.8), 1600)
    sizes = [
        errors(mesh, balanced_normals(mesh.vertices, mesh.topology, sweeps=sweeps)).mean().item()
        for sweeps in (0, 1, 2, 4, 8)
    ]
    assert all(later < earlier for earlier, later in itertools.pairwise(sizes))
    assert sizes[3] < 0.6 * sizes[0]


def test_the_condition_is_met_better_than_by_means():
    mesh = irregular_triangles(Enneper(), 400)
    v, w = mesh.topology.edges.unbind(1)
    edges = edge_vectors(mesh.vertices, mesh.topology)
    slopes = []
    for function in (vertex_normals, balanced_normals):
        normals = function(mesh.vertices, mesh.topology)
        slopes.append(((normals[v] + normals[w]) * edges).sum(-1).square().sum().item())
    assert slopes[1] < 0.1 * slopes[0]


@pytest.mark.parametrize("mesh", [tetrahedron, cube], ids=["tetrahedron", "cube"])
def test_symmetric_stars_are_balanced_already(mesh):
    vertices, topology = mesh()
    torch.testing.assert_close(balanced_normals(vertices, topology), vertex_normals(vertices, topology))


@pytest.mark.parametrize("lattice", LATTICES.keys())
def test_second_order_on_closed_lattices(lattice):
    sizes = []
    for n in (2, 4):
        mesh = LATTICES[lattice](Torus(2.0, 0.8), n)
        sizes.append(errors(mesh, balanced_normals(mesh.vertices, mesh.topology)).square().mean().sqrt().item())
    assert math.log2(sizes[0] / sizes[1]) > 1.9


@pytest.mark.parametrize("mesh", [*DEGENERATE.values(), lambda: capped_prism(5)])
def test_unit_length_or_zero_where_there_is_none(mesh):
    vertices, topology = mesh()
    lengths = torch.linalg.vector_norm(balanced_normals(vertices, topology), dim=-1)
    expected = torch.linalg.vector_norm(vertex_normals(vertices, topology), dim=-1)
    torch.testing.assert_close(lengths, expected)
