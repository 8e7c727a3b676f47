"""Irregular triangle meshes and icospheres."""

from __future__ import annotations

import math
import subprocess
import sys

import pytest
import torch

from torchfair.errors import MeshError
from torchfair.geometry import corner_angles, edge_lengths, face_normals
from torchfair.shapes import SURFACES, Enneper, Sphere, Torus, icosphere, irregular_triangles

SHAPES = {name: make() for name, make in SURFACES.items()} | {
    "cap": Sphere(2.0, (-0.5, math.pi / 2)),
    "octant without pole": Sphere(1.0, (0.0, 1.2), angles=(0.0, 1.5)),
}


def angles_in_degrees(mesh):
    return corner_angles(mesh.vertices, mesh.topology) * 180 / math.pi


@pytest.mark.parametrize(("count", "seed"), [(110, 1), (220, 0)])
@pytest.mark.parametrize("name", SHAPES)
def test_every_surface(name, count, seed):
    surface = SHAPES[name]
    mesh = irregular_triangles(surface, count, seed)
    topology = mesh.topology
    assert topology.num_vertices == count
    assert topology.is_triangular
    torch.testing.assert_close(mesh.vertices, surface.position(*mesh.parameters.T))
    euler = topology.num_vertices - topology.num_edges + topology.num_faces
    assert euler == sum(surface.poles) + (not surface.periodic[0])
    closed = all(surface.periodic) or all(surface.poles)
    assert len(topology.boundary_loops()) == (0 if closed else 2 - (euler == 1))
    assert topology.valences.min() >= 2
    facing = (face_normals(mesh.vertices, topology)[topology.corner_faces] * mesh.normals[topology.corners]).sum(-1)
    assert facing.min() > 0.2
    assert angles_in_degrees(mesh).min() > 20
    lengths = edge_lengths(mesh.vertices, topology)
    assert lengths.max() < 3 * lengths.min()


@pytest.mark.parametrize("name", ["torus", "enneper", "cone"])
def test_boundary_lies_on_the_boundary(name):
    mesh = irregular_triangles(SHAPES[name], 200)
    on_boundary = torch.zeros(200, dtype=torch.bool)
    for axis, ends in enumerate(mesh.surface.domain):
        if not mesh.surface.periodic[axis]:
            on_boundary |= (mesh.parameters[:, axis, None] - torch.tensor(ends, dtype=torch.float64)).abs().amin(
                1
            ) < 1e-12
    assert torch.equal(on_boundary, mesh.topology.is_boundary_vertex)


@pytest.mark.parametrize("name", ["torus", "paraboloid", "helicoid"])
def test_delaunay_on_the_surface(name):
    """Angles opposite every interior edge, measured in space, add up to at most 180 degrees."""
    mesh = irregular_triangles(SHAPES[name], 250)
    topology = mesh.topology
    angles = corner_angles(mesh.vertices, topology)
    facing = topology.corner_edges.view(-1, 3)[:, [1, 2, 0]].flatten()
    opposite = torch.zeros(topology.num_edges).double().index_add(0, facing, angles)
    assert opposite[: topology.num_interior_edges].max() <= math.pi + 1e-8


def test_no_pattern():
    """Unlike on a lattice, valences vary and edges point everywhere."""
    mesh = irregular_triangles(SURFACES["paraboloid"](0.0, 0.0), 300)
    valences = mesh.topology.valences[~mesh.topology.is_boundary_vertex]
    assert {5, 6, 7} <= set(valences.tolist())
    steps = mesh.vertices[mesh.topology.interior_edges].diff(dim=1)[:, 0]
    turns = torch.remainder(torch.atan2(steps[:, 1], steps[:, 0]), math.pi)
    assert torch.histc(turns, 12, 0, math.pi).min() > len(turns) / 24


def test_seed_decides():
    first, again, other = (irregular_triangles(Enneper(), 120, seed) for seed in (3, 3, 4))
    assert torch.equal(first.vertices, again.vertices)
    assert torch.equal(first.topology.corners, again.topology.corners)
    assert not torch.equal(first.vertices, other.vertices)


def test_errors():
    for make, message in (
        (lambda: irregular_triangles(Enneper(), 3), "count must be an integer of at least 12"),
        (lambda: irregular_triangles(Enneper(), 12), "the boundary alone takes"),
        (lambda: irregular_triangles(Enneper(), 100, -1), "seed must be an integer of at least 0"),
        (lambda: irregular_triangles(Torus(5.0, 0.1), 60), "too coarse to close up|is too small"),
        (lambda: irregular_triangles(Torus(5.0, 0.3), 173, 998), "faces would lie across the surface"),
        (lambda: irregular_triangles(Sphere(angles=(0.0, 1.0)), 100), "sector of a sphere"),
        (lambda: icosphere(-1), "subdivisions must be an integer of at least 0"),
        (lambda: icosphere(1.5), "subdivisions must be an integer"),
    ):
        with pytest.raises(MeshError, match=message):
            make()


@pytest.mark.parametrize("subdivisions", range(4))
def test_icosphere(subdivisions):
    mesh = icosphere(subdivisions, 2.0)
    topology = mesh.topology
    assert (topology.num_faces, topology.num_vertices) == (20 * 4**subdivisions, 10 * 4**subdivisions + 2)
    assert topology.num_interior_edges == topology.num_edges
    torch.testing.assert_close(mesh.vertices.norm(dim=1), torch.full((topology.num_vertices,), 2.0).double())
    assert sorted(topology.valences.unique().tolist()) == ([5] if subdivisions == 0 else [5, 6])
    outward = (face_normals(mesh.vertices, topology)[topology.corner_faces] * mesh.normals[topology.corners]).sum(-1)
    assert outward.min() > 0.7
    assert angles_in_degrees(mesh).min() > 54


def test_shapes_load_scipy_only_when_meshing():
    code = "import sys, torchfair.shapes; sys.exit(any(name.startswith('scipy.spatial') for name in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
