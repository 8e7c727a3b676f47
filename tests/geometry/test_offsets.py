"""Offsets at constant face distance: exact on conical meshes, and what is missing elsewhere is what is measured."""

from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import capped_prism, icosphere, random_polytope
from helpers import DOUBLE, cube, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.geometry import (
    conical_deviations,
    corner_angles,
    face_normals,
    offset_directions,
)
from torchfair.shapes import Cone, Cylinder, Hyperboloid, Sphere, Torus, irregular_triangles, principal_quads

REVOLUTION = {
    "cylinder": Cylinder(),
    "cone": Cone(),
    "hyperboloid": Hyperboloid(),
    "torus": Torus(2.0, 0.8),
    "sphere": Sphere(latitudes=(-1.0, 1.2)),
}


def misses(vertices: torch.Tensor, topology: Topology, distance: float) -> torch.Tensor:
    """(C,) what is missing for corners of the offset to be at the distance from their faces, over the distance."""
    moved = distance * offset_directions(vertices, topology)
    normals = face_normals(vertices, topology)[topology.corner_faces]
    return (moved[topology.corners] * normals).sum(1) / distance - 1.0


@pytest.mark.parametrize("surface", REVOLUTION.values(), ids=REVOLUTION.keys())
def test_quads_of_revolution_are_conical_and_have_an_exact_offset(surface) -> None:
    mesh = principal_quads(surface, 9, 14)
    assert conical_deviations(mesh.vertices, mesh.topology).max() < 1e-11
    assert misses(mesh.vertices, mesh.topology, 0.1).abs().max() < 1e-11
    offset = mesh.vertices + 0.1 * offset_directions(mesh.vertices, mesh.topology)
    normals, moved = (face_normals(points, mesh.topology) for points in (mesh.vertices, offset))
    torch.testing.assert_close(moved, normals, atol=1e-9, rtol=0)  # parallel faces
    centres = [points[mesh.topology.corners].view(-1, 4, 3).mean(1) for points in (mesh.vertices, offset)]
    distances = ((centres[1] - centres[0]) * normals).sum(1)
    torch.testing.assert_close(distances, torch.full_like(distances, 0.1), atol=1e-11, rtol=0)


def test_conical_vertices_of_valence_four_have_equal_sums_of_opposite_angles() -> None:
    """The criterion of Liu et al. 2006, which knows no normals: a1 + a3 = a2 + a4."""
    mesh = principal_quads(Torus(2.0, 0.8), 8, 12)
    vertices = mesh.vertices

    def criterion(points: torch.Tensor) -> torch.Tensor:
        angles = corner_angles(points, mesh.topology)
        place = {
            (int(v), int(f)): i
            for i, (v, f) in enumerate(zip(mesh.topology.corners, mesh.topology.corner_faces, strict=True))
        }
        result = []
        for v in range(len(points)):
            around = [f for f, face in enumerate(mesh.topology.face_lists()) if v in face]
            first = around[0]
            edges = set(mesh.topology.face_lists()[first])
            (opposite,) = (f for f in around[1:] if edges & set(mesh.topology.face_lists()[f]) == {v})
            same = angles[place[v, first]] + angles[place[v, opposite]]
            rest = sum(angles[place[v, f]] for f in around if f not in (first, opposite))
            result.append(float(same - rest))
        return torch.tensor(result, dtype=DOUBLE)

    assert criterion(vertices).abs().max() < 1e-12
    sheared = vertices @ torch.tensor([[1.0, 0.3, 0.0], [0.0, 1.0, 0.2], [0.1, 0.0, 0.9]], dtype=DOUBLE)  # planar still
    found, expected = conical_deviations(sheared, mesh.topology), criterion(sheared).abs()
    assert expected.max() > 0.05
    assert torch.equal(found > 1e-10, expected > 1e-10)
    ranks = [x.argsort().argsort().to(DOUBLE) for x in (found, expected)]
    assert torch.corrcoef(torch.stack(ranks))[0, 1] > 0.7


def test_bodies_whose_vertices_have_three_faces_always_have_one() -> None:
    for mesh in (cube(), tetrahedron(), capped_prism(7)):
        assert conical_deviations(*mesh).max() < 1e-11
        assert misses(*mesh, 0.3).abs().max() < 1e-11
    vertices, topology = cube()
    torch.testing.assert_close(vertices + 0.5 * offset_directions(vertices, topology), 2 * vertices - 0.5)


def test_best_in_the_least_squares_sense_and_what_is_missing_is_measured() -> None:
    vertices, topology = random_polytope(3)
    directions, deviations = offset_directions(vertices, topology), conical_deviations(vertices, topology)
    normals = face_normals(vertices, topology)
    for v in range(len(vertices)):
        around = [f for f, face in enumerate(topology.face_lists()) if v in face]
        matrix = normals[around]
        best = torch.linalg.lstsq(matrix, torch.ones(len(around), 1, dtype=DOUBLE), driver="gelsd").solution[:, 0]
        torch.testing.assert_close(directions[v], best, atol=1e-6, rtol=1e-6)
        missing = (matrix @ best - 1.0).square().mean().sqrt()
        torch.testing.assert_close(deviations[v], missing, atol=1e-9, rtol=1e-6)
    assert deviations.max() > 0.01


def test_a_cone_of_revolution_has_one_over_the_cosine() -> None:
    angles = torch.arange(7, dtype=DOUBLE) * 2 * math.pi / 7
    rim = torch.stack([angles.cos(), angles.sin(), torch.full_like(angles, -0.5)], dim=1)
    vertices = torch.cat([torch.zeros(1, 3, dtype=DOUBLE), rim])
    topology = Topology.from_faces([[0, 1 + i, 1 + (i + 1) % 7] for i in range(7)])
    slope = face_normals(vertices, topology)[0, 2]
    torch.testing.assert_close(offset_directions(vertices, topology)[0], torch.tensor([0, 0, 1 / slope], dtype=DOUBLE))
    assert conical_deviations(vertices, topology)[0] < 1e-12


def test_flat_stars_move_along_their_normal() -> None:
    vertices, topology = wavy_grid(5, 5, triangles=True)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE).expand_as(flat)
    torch.testing.assert_close(offset_directions(flat, topology), up, atol=1e-12, rtol=0)
    assert conical_deviations(flat, topology).max() < 1e-14


def test_of_second_order_on_any_mesh_of_a_smooth_surface() -> None:
    means = []
    for count in (300, 1200):
        mesh = irregular_triangles(Torus(2.0, 0.8), count)
        means.append(conical_deviations(mesh.vertices, mesh.topology).mean().item())
    assert means[1] > 1e-4
    assert math.log2(means[0] / means[1]) == pytest.approx(2, abs=0.5)


def test_single_precision() -> None:
    for vertices, topology in (icosphere(1), wavy_grid()):
        single = offset_directions(vertices.float(), topology)
        assert single.dtype == torch.float32
        torch.testing.assert_close(single.double(), offset_directions(vertices, topology), atol=2e-3, rtol=2e-3)


def test_faces_without_area_do_not_count() -> None:
    """A sliver of no area between two faces of a star: the same offset, the same deviation as without it."""
    angles = torch.tensor([0.0, 1.0, 2.2, 3.5, 4.9], dtype=DOUBLE)
    rim = torch.stack([angles.cos(), angles.sin(), torch.tensor([0.2, -0.3, 0.1, 0.4, -0.2], dtype=DOUBLE)], dim=1)
    plain = torch.cat([torch.zeros(1, 3, dtype=DOUBLE), rim])
    faces = [[0, 1 + i, 1 + (i + 1) % 5] for i in range(5)]
    more = torch.cat([plain, 2.0 * rim[4:]])  # beyond the fifth vertex of the rim, on the same ray
    split = [*faces[:4], [0, 5, 6], [0, 6, 1]]
    for function in (offset_directions, conical_deviations):
        expected = function(torch.cat([plain[:5], more[6:]]), Topology.from_faces(faces))[0]
        torch.testing.assert_close(function(more, Topology.from_faces(split))[0], expected)
    assert conical_deviations(plain, Topology.from_faces(faces))[0] > 0.01
