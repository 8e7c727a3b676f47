"""Edges of coarse meshes turn to the principal directions; faces keep room."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from helpers import grid_faces
from meshing_tools import Graph, MonkeySaddle, ellipsoid
from torch import Tensor

from torchfair import Topology
from torchfair.energies.normal_variation import normal_variation_per_edge
from torchfair.geometry import corner_angles, face_areas
from torchfair.meshing import (
    MeshingSettings,
    QuadMesh,
    TriangleMesh,
    alignment,
    lattice_rows,
    principal_quads,
    principal_triangles,
)
from torchfair.meshing.components import read_surface
from torchfair.meshing.face_room import FaceRoom
from torchfair.meshing.steps import Steps
from torchfair.shapes import Catenoid, Surface, Torus, irregular_triangles


class EggCrate(Graph):
    """Bumps that are two quads wide where 60 are asked for."""

    def height(self, u: Tensor, v: Tensor) -> Tensor:
        return 0.15 * torch.sin(3 * u) * torch.sin(3 * v)


class Slanted(Graph):
    """A saddle whose principal directions are aslant to all sides."""

    def height(self, u: Tensor, v: Tensor) -> Tensor:
        return 0.3 * (u**2 - v**2) + 0.4 * u * v


class Tube(Graph):
    """Half a cylinder and less."""

    def height(self, u: Tensor, v: Tensor) -> Tensor:
        return torch.sqrt(2 - u**2)


def mesh_of(surface: Surface, count: int) -> QuadMesh:
    made = irregular_triangles(surface, 1200)
    return principal_quads(made.vertices, made.topology, count=count)


def without_moves(surface: Surface, count: int, monkeypatch: pytest.MonkeyPatch) -> QuadMesh:
    of_quads = sys.modules["torchfair.meshing.principal_quads"]  # the package has a function of that name
    with monkeypatch.context() as patch:
        patch.setattr(of_quads, "aligned", lambda pieces, *others: pieces)
        return mesh_of(surface, count)


@pytest.mark.parametrize(("surface", "share"), [(EggCrate(), 0.7), (Slanted(), 1.0), (Catenoid(), 0.4)])
def test_edges_turn_to_directions(surface: Surface, share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the mean and 95 %; the lines of the second follow directions exactly, but at the boundary."""
    moved, start = mesh_of(surface, 120), without_moves(surface, 120, monkeypatch)
    off = [mesh.report["angle_mean_degrees"] + mesh.report["angle_95_degrees"] / 4 for mesh in (moved, start)]
    assert off[0] < share * off[1]
    assert torch.equal(moved.topology.corners, start.topology.corners)
    outer = start.topology.is_boundary_vertex
    assert torch.equal(moved.vertices[outer], start.vertices[outer])
    areas = face_areas(moved.vertices, moved.topology)
    assert float(areas.min()) > 0.05 * float(areas.mean())


def test_all_stay_where_edges_would_turn_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """Moves of a mesh whose inner edges are on directions are taken back, the third round with the first."""
    start, steps = without_moves(Catenoid(), 60, monkeypatch), np.random.default_rng(0)
    made: list[int] = []

    def worse(points: np.ndarray, *others: object) -> np.ndarray:
        made.append(len(points))
        return 0.03 * steps.normal(size=points.shape)

    monkeypatch.setattr(alignment, "_moves", worse)
    assert torch.equal(mesh_of(Catenoid(), 60).vertices, start.vertices)
    assert made == 3 * [len(start.vertices)]


def test_edges_that_follow_directions_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within a thousandth, as those of a cylinder do; where there are none, as in a plane, they stay anyway."""
    monkeypatch.delattr(alignment, "_moves")
    assert mesh_of(Tube(), 200).report["angle_mean_degrees"] < 0.01
    with pytest.raises(NameError, match="_moves"):  # others are not
        mesh_of(EggCrate(), 60)


def test_adaptive_quads_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    made, settings = irregular_triangles(Catenoid(), 600), MeshingSettings(adaptive=True)
    found = principal_quads(made.vertices, made.topology, count=60, settings=settings)
    monkeypatch.delattr(alignment, "_moves")
    again = principal_quads(made.vertices, made.topology, count=60, settings=settings)
    assert torch.equal(again.vertices, found.vertices)
    with pytest.raises(NameError, match="_moves"):  # which others need
        principal_quads(made.vertices, made.topology, count=60)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_components_are_aligned_as_if_they_were_alone(noise: float) -> None:
    """Whatever surface lies close by, and however rough it is, which smooths its own directions over more."""
    surface = irregular_triangles(Catenoid(), 400)
    shape, topology = surface.vertices, surface.topology
    random = torch.randn(shape.shape, generator=torch.Generator().manual_seed(0), dtype=shape.dtype)
    near = 1.02 * shape.flip(1) * torch.tensor([1.0, 1.0, -1.0]) + noise * random
    faces = torch.cat([topology.triangles, topology.triangles + len(shape)])
    both = torch.cat([near, shape]), Topology.from_faces(faces)
    alone, beside = (principal_quads(*of, spacing=0.4).vertices for of in ((shape, topology), both))
    torch.testing.assert_close(beside[-len(alone) :], alone, atol=1e-9, rtol=0)


def test_singular_points_go_with_their_vertices() -> None:
    surface, topology = ellipsoid()
    mesh = principal_quads(surface, topology, count=120)
    valences = mesh.topology.valences
    at = (mesh.vertices[:, None] == mesh.singular_points).all(-1).any(1)
    assert at[valences != 4].all()
    assert int(at.sum()) == len(mesh.singular_points) == 8
    assert mesh.report["angle_mean_degrees"] < 0.5


def test_moved_vertices_stay_on_the_surface() -> None:
    made = irregular_triangles(EggCrate(), 1200)
    flat = principal_quads(made.vertices, made.topology, count=60, settings=MeshingSettings(curved=False))
    assert float(flat.surface.reference.closest(flat.vertices).distances.max()) < 1e-9
    curved = mesh_of(EggCrate(), 60).vertices
    height = 0.15 * torch.sin(3 * curved[:, 0]) * torch.sin(3 * curved[:, 1])
    assert float((curved[:, 2] - height).abs().max()) < 2e-3


def lattice() -> tuple[np.ndarray, Topology]:
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
    return points, Topology.from_faces(torch.from_numpy(np.asarray(grid_faces(4, 4))), 16)


@pytest.mark.parametrize(
    ("to", "is_tight"),
    [((1.2, 1.2), False), ((0.31, 1.0), False), ((0.2, 1.0), True), ((2.5, 1.0), True), ((1.45, 1.45), False)],
)
def test_faces_keep_room(to: tuple[float, float], is_tight: bool) -> None:
    """One corner of unit squares moves: sides above 0.27, angles from 25 to 185 degrees, none turned over."""
    points, topology = lattice()
    moved = points.copy()
    moved[5, :2] = to
    tight = FaceRoom.of(topology, points, 1.0, math.radians(25)).tight(moved)
    assert tight.any() == is_tight
    assert tight[5] == is_tight
    assert not tight[15]


def test_angles_and_areas_are_bounded() -> None:
    points, topology = lattice()
    room = FaceRoom.of(topology, points, 1.0, math.radians(25))
    sheared = points.copy()
    sheared[:, 0] += sheared[:, 1] / math.tan(math.radians(24))  # all sides are long, areas are the same
    assert room.tight(sheared).all()
    sheared[:, 0] = points[:, 0] + points[:, 1] / math.tan(math.radians(26))
    assert not room.tight(sheared).any()
    assert float(corner_angles(torch.from_numpy(sheared), topology).min()) < math.radians(27)
    flat = points * [1, 0.31, 1]
    assert not room.tight(flat * [0.35, 1, 1]).any()
    assert room.tight(flat * [0.31, 1, 1]).any()  # sides 0.31, areas 0.096


def test_what_is_tight_at_first_may_stay() -> None:
    points, topology = lattice()
    points = points * [1, 0.05, 1]
    assert not FaceRoom.of(topology, points, 1.0, math.radians(25)).tight(points).any()


# ---- triangles in rows ---------------------------------------------------------------------------------


def triangles_of(surface: Surface, count: int) -> TriangleMesh:
    made = irregular_triangles(surface, 1200)
    return principal_triangles(made.vertices, made.topology, count=count)


@pytest.mark.parametrize(("surface", "share"), [(MonkeySaddle(), 0.8), (Torus(), 0.5)])
def test_rows_turn_to_directions(surface: Surface, share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """E where K is negative does not rise, nor do angles become sharp."""
    moved = triangles_of(surface, 300)
    monkeypatch.setattr(lattice_rows, "aligned", lambda pieces, *others, **more: pieces)
    start = triangles_of(surface, 300)
    off = [mesh.report["angle_mean_degrees"] + mesh.report["angle_95_degrees"] / 4 for mesh in (moved, start)]
    assert off[0] < share * off[1]
    assert torch.equal(moved.topology.corners, start.topology.corners)
    assert torch.equal(moved.principal.mask, start.principal.mask)
    outer = start.topology.is_boundary_vertex
    assert torch.equal(moved.vertices[outer], start.vertices[outer])
    sharpest = [float(corner_angles(mesh.vertices, mesh.topology).min()) for mesh in (moved, start)]
    assert sharpest[0] > min(sharpest[1], math.radians(15)) - math.radians(1)


def test_adaptive_triangles_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(lattice_rows, "aligned")
    made = irregular_triangles(Catenoid(), 600)
    principal_triangles(made.vertices, made.topology, count=80, settings=MeshingSettings(adaptive=True))
    with pytest.raises(NameError, match="aligned"):  # which others need
        principal_triangles(made.vertices, made.topology, count=80)


def test_rounds_that_raise_energy_where_curvature_is_negative_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment, "_off", lambda points, *others: 2.0 - float(points[0, 0] > 50))  # moved are better
    energies = [1.0, 1.01, 1.001, 1.01]
    monkeypatch.setattr(alignment, "_saddle_energy", lambda *others: energies.pop(0))
    made: list[np.ndarray] = []

    class Tracker(alignment.ClosestPointTracker):
        def closest(self, points: Tensor) -> SimpleNamespace:  # type: ignore[override]
            made.append(points.numpy() + 100)
            return SimpleNamespace(positions=torch.from_numpy(made[-1]))

    monkeypatch.setattr(alignment, "ClosestPointTracker", Tracker)
    monkeypatch.setattr(alignment, "_moves", lambda points, *others: 0 * points)
    monkeypatch.setattr(alignment, "_with_room", lambda room, points, moves, held: moves)
    surface = irregular_triangles(Torus(), 200)
    read = read_surface(surface.vertices, surface.topology, MeshingSettings())
    faces, start = surface.topology.triangles.tolist(), surface.vertices.numpy()
    free = np.zeros(len(start), bool)
    found = alignment._aligned(start, faces, {(0, 1)}, free, read, 0.3, 0.02)
    assert energies == []
    assert np.array_equal(found, made[1])
    energies[:] = [1.0, 1.01, 1.01, 1.01]
    assert alignment._aligned(start, faces, {(0, 1)}, free, read, 0.3, 0.02) is start


def test_energy_of_saddles_leaves_out_the_rest() -> None:
    """Of a torus that of the inner half."""
    mesh = irregular_triangles(Torus(2.0, 0.8), 400)
    surface = read_surface(mesh.vertices, mesh.topology, MeshingSettings())
    found = alignment._saddle_energy(mesh.vertices.numpy(), mesh.topology, surface)
    inside = mesh.vertices[mesh.topology.interior_edges].mean(1)[:, :2].norm(dim=1) < 2
    assert found == pytest.approx(
        float(normal_variation_per_edge(mesh.vertices, mesh.topology)[inside].sum()), rel=0.05
    )


def test_steps_are_rows_and_medians_across_them() -> None:
    """Of two triangles beside each other on a row, a third with two sides on rows, and one with none."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0], [3, 1, 0], [2, 2, 0]])
    topology = Topology.from_faces([[0, 1, 2], [0, 3, 1], [1, 4, 2], [2, 4, 5]], 6)
    steps = Steps.of(topology, {(0, 1), (2, 4), (1, 2)})
    inner = topology.interior_edges.tolist()
    assert steps.edges.tolist() == [sorted(edge) in ([0, 1], [2, 4], [1, 2]) for edge in inner]
    along, middles = steps.differences @ points, steps.middles @ points
    rows = int(steps.edges.sum())
    assert rows == 3
    medians = {tuple(a) + tuple(m) for a, m in zip(along[rows:].tolist(), middles[rows:].tolist(), strict=True)}
    assert medians == {(0.0, -1.0, 0.0, 1.0, -0.5, 0.0), (0.0, 1.0, 0.0, 2.0, 1.5, 0.0)}
    ends = points[topology.interior_edges.numpy()[steps.edges]]
    assert np.array_equal(along[:rows], ends[:, 1] - ends[:, 0])
    assert np.array_equal(middles[:rows], ends.mean(1))
    assert steps.weights[rows:].max() < steps.weights[:rows].min() == 1
    whole = Steps.of(topology, None)
    assert whole.edges.all()
    assert whole.differences.shape == (len(inner), 6)
