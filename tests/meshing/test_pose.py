"""Surfaces are meshed in a place that their shape says."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import torch
from creased_shapes import box
from helpers import random_rotation
from meshing_tools import Mesh, ellipsoid, irregular, shuffled
from torch import Tensor

from torchfair.fields import Directions
from torchfair.meshing import (
    MeshingSettings,
    NoMeshError,
    QuadMesh,
    TriangleMesh,
    prepared,
    principal_quads,
    principal_triangles,
)
from torchfair.meshing.components import read_surface
from torchfair.meshing.failed_attempt import FailedAttemptError
from torchfair.meshing.numbering import numbered_by_geometry
from torchfair.meshing.piece_mesh import PieceMesh
from torchfair.meshing.pose import Pose
from torchfair.meshing.row_distances import row_distance
from torchfair.meshing.surface import DesignSurface, components_of
from torchfair.shapes import FreeFormPatch, PrincipalParaboloid

SHAPES = {
    "saddle": irregular(PrincipalParaboloid(1.0, -0.5, (0.8, 0.8)), 200),
    "free form": irregular(FreeFormPatch(), 300),
    "ellipsoid": ellipsoid(2),
    "box": box(4, (1.0, 0.8, 0.6)),
    "cube": box(4),
}


def moved(mesh: Mesh, seed: int, size: float = 1.0) -> Mesh:
    """The same elsewhere, larger, with other numbers."""
    vertices, topology = shuffled(*mesh, seed)
    away = torch.tensor([3.0, -1.0, 20.0], dtype=torch.float64)
    return size * (vertices @ random_rotation(seed).T + away), topology


def part_of(mesh: Mesh) -> DesignSurface:
    return components_of(*mesh)[0]


def profile(vertices: Tensor) -> Tensor:
    """Distances of vertices from their middle in order: the same after rigid motions."""
    return (vertices - vertices.mean(0)).norm(dim=1).sort().values


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SHAPES)
def test_the_pose_is_the_same_to_the_last_bit_after_motions(name: str, seed: int) -> None:
    here = part_of(SHAPES[name])
    there = part_of(moved(SHAPES[name], seed, 1000 / 7))
    assert torch.equal(here.topology.triangles, there.topology.triangles)
    assert np.array_equal(here.pose.placed, there.pose.placed)
    assert here.pose.length(0.1) == there.pose.length(0.1 * 1000 / 7)
    found = [read_surface(*of, MeshingSettings()) for of in (SHAPES[name], moved(SHAPES[name], seed, 1000 / 7))]
    one, other = (of.parts[0].pose.directions(of.fields[0]) for of in found)
    assert np.array_equal(one.at_corners, other.at_corners)
    assert np.array_equal(one.confidence, other.confidence)


@pytest.mark.parametrize("height", [1e-6, 1e-8, 1e-12])
def test_thin_surfaces_have_a_pose(height: float) -> None:
    """Also where all vertices are on the first axis but for less than what counts as equal."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, height, 0.0]])
    pose = Pose.of(points, np.array([[0, 1, 2]]))
    np.testing.assert_allclose(pose.axes @ pose.axes.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(pose.placed @ pose.axes * pose.size + pose.origin, points, atol=1e-9)


def test_vertices_come_back_to_the_last_bit() -> None:
    """Also far from the origin, where a motion there and back would round them."""
    vertices, topology = moved(SHAPES["ellipsoid"], 5, 100 / 7)
    part = part_of((vertices, topology))
    assert np.array_equal(part.pose.back(part.pose.placed), part.vertices.numpy())


def test_it_is_a_rigid_motion_to_the_centroid() -> None:
    pose = part_of(moved(SHAPES["free form"], 1, 5.0)).pose
    assert np.allclose(pose.axes @ pose.axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(pose.axes) > 0
    assert np.linalg.norm(pose.placed, axis=1).max() == pytest.approx(1)
    corners = pose.placed[pose.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert np.abs(areas @ corners.mean(1)).max() < 1e-8 * areas.sum()
    gaps = np.linalg.norm(np.diff(pose.given, axis=0), axis=1)
    assert np.allclose(np.linalg.norm(np.diff(pose.placed, axis=0), axis=1) * pose.size, gaps, atol=1e-7)


def test_points_go_back_exactly() -> None:
    """What was rounded off vertices, up to 2e-9 of the size, is added to points between them, too."""
    pose = part_of(moved(SHAPES["free form"], 2)).pose
    assert np.array_equal(pose.back(pose.placed), pose.given)
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), len(pose.triangles))
    placed, given = ((weights[..., None] * of[pose.triangles]).sum(1) for of in (pose.placed, pose.given))
    assert np.abs(pose.back(placed) - given).max() < 1e-13 * pose.size
    assert pose.back(np.zeros((0, 3))).shape == (0, 3)


def test_thin_triangles_are_not_rounded_away() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.4, 1e-8, 0], [0.5, 1, 0]])
    pose = Pose.of(points, np.array([[0, 1, 2], [0, 2, 3], [2, 1, 3]]))
    assert np.abs(pose.placed @ pose.axes * pose.size + pose.origin - points).max() < 1e-15


def test_what_is_flat_but_for_rounding_has_no_directions() -> None:
    pose = part_of(SHAPES["box"]).pose
    noise = 1e-12 * np.exp(1j * np.arange(6.0)).reshape(2, 3)
    found = pose.directions(Directions(noise, np.full(2, 1e-12), np.full(2, 1e-18)))
    assert not any(of.any() for of in (found.at_corners, found.means, found.confidence))


def test_rows_are_as_far_apart_to_the_last_bit_after_motions() -> None:
    """Their distance is chosen before a surface is placed."""
    meshes = [SHAPES["saddle"], *(moved(SHAPES["saddle"], seed, 1000 / 7) for seed in range(5))]
    read = [read_surface(*mesh, MeshingSettings()) for mesh in meshes]
    assert len({row_distance(of.frames, of.directions) for of in read}) == 1


@pytest.mark.parametrize("failures", [1, 10**9])
def test_places_are_told_where_the_surface_is(failures: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In notes on creases that are lines no more, and where nothing was found: they are known in the pose."""
    vertices, topology = moved(SHAPES["box"], 4, 10.0)
    settings, attempt, left = MeshingSettings(crease_angle=0.5), prepared.attempt, [failures]
    first = part_of((vertices, topology)).vertices[0]

    def failing(surface: DesignSurface, *others: Any) -> PieceMesh:
        left[0] -= 1
        if left[0] >= 0:
            raise FailedAttemptError("no room", 0, surface.vertices[0].numpy())
        return attempt(surface, *others)

    monkeypatch.setattr(prepared, "attempt", failing)
    try:
        told = " ".join(principal_quads(vertices, topology, count=150, settings=settings).notes)
        assert "creases not aligned near (" in told
    except NoMeshError as error:
        told = str(error)
        assert failures > 1
    numbers = re.search(r"near (?:vertex 0 at )?\((.*?)\)", told)
    assert numbers is not None
    assert np.allclose([float(of) for of in numbers[1].split(", ")], first.numpy(), rtol=5e-3)


@pytest.mark.parametrize("seed", range(4))
def test_vertices_of_a_cube_are_numbered_alike_wherever_it_is(seed: int) -> None:
    """All of its corners are as far away: coordinates chose among them, and with them another order."""
    vertices, topology = SHAPES["cube"]
    order, triangles = numbered_by_geometry(vertices, topology.triangles)
    again, other = moved(SHAPES["cube"], seed)
    renumbered, as_before = numbered_by_geometry(again, other.triangles)
    assert torch.equal(as_before, triangles)
    here, there = ((of[:, None] - of).norm(dim=2) for of in (vertices[order], again[renumbered]))
    assert torch.allclose(there, here)


def counted(found: QuadMesh | TriangleMesh) -> tuple[int, Tensor]:
    return found.topology.num_faces, profile(found.vertices)


@pytest.mark.parametrize("seed", [1, 2])
def test_triangles_of_a_box_do_not_depend_on_where_it_is(seed: int) -> None:
    """They were 292, 306, 258, 314 or 284, as it was rotated: rounding chose where rows changed their direction."""
    mesh = box(13, (1.0, 0.8, 0.6))
    count, shape = counted(principal_triangles(*mesh, count=300))
    again, same = counted(principal_triangles(*moved(mesh, seed), count=300))
    assert again == count
    assert torch.allclose(same, shape, atol=1e-7)


def test_quads_do_not_depend_on_where_a_surface_is() -> None:
    mesh = irregular(FreeFormPatch(), 800)
    first = principal_quads(*mesh, count=200)
    (count, shape), (again, same) = counted(first), counted(principal_quads(*moved(mesh, 3, 1e3), count=200))
    assert again == count
    assert torch.allclose(same / 1e3, shape, atol=1e-7)
