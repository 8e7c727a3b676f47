"""Triangles where rows of a lattice turn back around umbilics: none is turned over."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import face_centres, face_normals
from torchfair.meshing import MeshingSettings, TriangleMesh, lattice_rows, principal_triangles
from torchfair.meshing.components import Pieces, read_surface
from torchfair.meshing.mesh_creases import MeshCreases
from torchfair.meshing.three_valent import between, with_three_valent_inside
from torchfair.meshing.turned_over import turned_over
from torchfair.shapes import icosphere

HALF_LONG, LONG = (1.3, 0.9, 0.7), (1.0, 0.45, 0.3)


def ellipsoid(axes: tuple[float, float, float]) -> tuple[Tensor, Topology]:
    """Turned so that no symmetry of the icosphere is shared."""
    sphere = icosphere(3)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    return sphere.vertices @ torch.from_numpy(turn) * torch.tensor(axes, dtype=torch.float64), sphere.topology


def turned(mesh: TriangleMesh, axes: tuple[float, float, float]) -> int:
    """Triangles that look inward, by the exact normals."""
    outward = face_centres(mesh.vertices, mesh.topology) / torch.tensor(axes, dtype=torch.float64) ** 2
    return int(((face_normals(mesh.vertices, mesh.topology) * outward).sum(1) <= 0).sum())


def weights_in(points: Tensor, corners: Tensor) -> Tensor:
    """(n, 3) barycentric coordinates of projections, by least squares."""
    rows = torch.cat([corners.mT, torch.ones(len(points), 1, 3)], 1)
    right = torch.cat([points, torch.ones(len(points), 1)], 1)
    normal = torch.linalg.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    off = ((points - corners[:, 0]) * normal).sum(1, keepdim=True) / normal.square().sum(1, keepdim=True) * normal
    right[:, :3] -= off
    return torch.linalg.lstsq(rows, right[..., None]).solution[..., 0]


def test_points_move_towards_the_first_corner_and_then_towards_the_middle() -> None:
    torch.manual_seed(0)
    corners = torch.randn(80, 3, 3, dtype=torch.float64)
    points = corners.mean(1) + 0.3 * torch.randn(80, 3, dtype=torch.float64)
    before, moved = weights_in(points, corners), between(points, corners)
    after = weights_in(moved, corners)
    assert (after[:, 0] > 0.25 - 1e-9).all()
    assert (after > 0.1 - 1e-9).all()
    stay = (before[:, 0] >= 0.25) & (before.amin(1) >= 0.1)
    assert 5 < stay.sum() < 75
    assert torch.equal(moved[stay], points[stay])
    along = (before[:, 0] < 0.25) & (after[:, 1:].amin(1) > 0.1 + 1e-9)  # the first step was enough
    assert along.sum() > 5
    assert torch.allclose(after[along, 0], torch.tensor(0.25, dtype=torch.float64))
    step, whole = (moved - points)[along], (corners[:, 0] - points)[along]
    assert torch.linalg.cross(step, whole).norm(dim=1).max() < 1e-12
    middle = (before[:, 0] >= 0.25) & (before.amin(1) < 0.1)
    assert middle.sum() > 5
    assert torch.allclose(after[middle].amin(1), torch.tensor(0.1, dtype=torch.float64))
    step, whole = (moved - points)[middle], (corners.mean(1) - points)[middle]
    assert torch.linalg.cross(step, whole).norm(dim=1).max() < 1e-12


def test_points_move_to_the_middle_of_triangles_without_area() -> None:
    line = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [3, 0, 0]]], dtype=torch.float64)
    assert torch.allclose(between(torch.ones(1, 3, dtype=torch.float64), line), line.mean(1))


def test_three_valent_vertices_lie_between_their_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    found = principal_triangles(*ellipsoid(HALF_LONG), count=300)
    assert turned(found, HALF_LONG) == 0
    assert found.notes == []
    assert found.topology.valences.unique(return_counts=True)[1].tolist()[0] == 4
    at = (found.vertices[:, None] == found.singular_points).all(-1).any(1)
    assert found.topology.valences[at].tolist() == [3] * 4
    off = found.vertices / torch.tensor(HALF_LONG, dtype=torch.float64)
    assert (off.norm(dim=1) - 1).abs().max() < 0.005  # those that moved, too
    monkeypatch.setattr(lattice_rows, "with_three_valent_inside", lambda pieces, surface: pieces)
    alone = principal_triangles(*ellipsoid(HALF_LONG), count=300, settings=MeshingSettings(fallback=False))
    assert turned(alone, HALF_LONG) == 4
    assert torch.equal(alone.vertices[~at], found.vertices[~at])
    assert any("4 triangles are turned over, one at" in note for note in alone.notes)


def test_three_valent_vertices_on_creases_stay() -> None:
    """One of two that lie off their triangles, at the tops of two flat pyramids."""
    one = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.9, 0.05, 0.01]], dtype=torch.float64)
    positions = torch.cat([one, one + torch.tensor([4.0, 0, 0])])
    faces = [[a + k, b + k, 3 + k] for k in (0, 4) for a, b in ((0, 1), (1, 2), (2, 0))]
    surface = read_surface(*ellipsoid(HALF_LONG), MeshingSettings())
    creases = MeshCreases(torch.tensor([[0, 3], [1, 3]]), torch.zeros(0, 2, 3))
    rows = {(0, 3), (4, 7)}
    none = torch.zeros(0)
    pieces = Pieces(
        positions.numpy(), faces, rows, creases, torch.zeros(0, 3).double(), none, [], [0], [len(positions)], None
    )
    moved = torch.from_numpy(with_three_valent_inside(pieces, surface).positions) != positions
    assert moved.any(1).tolist() == [False] * 7 + [True]


def test_rows_follow_the_other_curvature_where_triangles_would_be_turned_over() -> None:
    found = principal_triangles(*ellipsoid(LONG), count=400)
    assert turned(found, LONG) == 0
    assert any("rows follow the larger curvature" in note for note in found.notes)
    assert found.report["singular"] == {"0.5": 4}
    assert found.report["angle_mean_degrees"] < 1
    along = found.vertices[found.topology.edges[found.principal.mask]]
    middle = along.mean(1)[:, 0].abs() < 0.5
    step = torch.nn.functional.normalize(along[:, 1] - along[:, 0], dim=1)[middle]
    assert (step[:, 0].abs() < 0.3).all()  # around the long axis
    kept = principal_triangles(*ellipsoid(LONG), count=400, settings=MeshingSettings(fallback=False))
    assert turned(kept, LONG) > 0
    assert "turned over, one at (" in kept.notes[-1]


def test_the_note_counts_triangles_of_the_mesh_that_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rows along the other curvature turn over more."""
    numbers = [[0, 1], [2, 3, 4]]
    monkeypatch.setattr(lattice_rows, "turned_over", lambda *_: torch.tensor(numbers.pop(0) if numbers else [0, 1]))
    found = principal_triangles(*ellipsoid(HALF_LONG), count=200)
    assert "2 triangles are turned over, one at (" in found.notes[-1]
    assert not any("rows follow" in note for note in found.notes)


def test_faces_that_look_inward_are_turned_over() -> None:
    vertices, topology = ellipsoid(HALF_LONG)
    surface = read_surface(vertices, topology, MeshingSettings())
    none = torch.zeros(0, 2, dtype=torch.int64)
    creases = MeshCreases(none, torch.zeros(0, 2, 3))

    def found(corners: list[list[int]]) -> list[int]:
        given = Pieces(
            vertices.numpy(), corners, set(), creases, torch.zeros(0, 3), torch.zeros(0), [], [], [len(vertices)], None
        )
        return turned_over(given, surface).tolist()

    assert found(topology.triangles.tolist()) == []
    inward = [face[::-1] for face in topology.triangles.tolist()]
    assert len(found(inward)) == len(inward)
