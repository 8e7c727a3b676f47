"""Triangles where rows of a lattice turn back around umbilics: none is turned over."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import face_centres, face_normals
from torchfair.meshing import MeshingSettings, TriangleMesh, lattice_rows, principal_triangles, unfolding
from torchfair.meshing.components import Pieces, ReadSurface, read_surface
from torchfair.meshing.mesh_creases import MeshCreases
from torchfair.meshing.three_valent import between, with_three_valent_inside
from torchfair.meshing.turned_over import turned_over
from torchfair.meshing.unfolding import unfolded
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
    for step in ("with_three_valent_inside", "unfolded", "aligned"):
        monkeypatch.setattr(lattice_rows, step, lambda pieces, *others, **more: pieces)
    alone = principal_triangles(*ellipsoid(HALF_LONG), count=300, settings=MeshingSettings(fallback=False))
    assert turned(alone, HALF_LONG) == 4
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


def test_vertices_move_where_rows_turn_back_and_triangles_would_be_turned_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows along the long axis stay, and E is near C; around it they had 1.68."""
    found = principal_triangles(*ellipsoid(LONG), count=400)
    assert turned(found, LONG) == 0
    assert found.notes == []
    assert inner_valences(found) == [3] * 4 + [6] * (found.topology.num_vertices - 4)
    assert found.report["variation_over_curvature"] < 1.35
    assert found.report["smallest_angle_degrees"] > 5
    along = found.vertices[found.topology.edges[found.principal.mask]]
    step = torch.nn.functional.normalize(along[:, 1] - along[:, 0], dim=1)[along.mean(1)[:, 0].abs() < 0.5]
    assert (step[:, 0].abs() > 0.7).all()
    monkeypatch.setattr(lattice_rows, "unfolded", lambda pieces, surface: pieces)
    kept = principal_triangles(*ellipsoid(LONG), count=400, settings=MeshingSettings(fallback=False))
    assert turned(kept, LONG) > 0
    assert "turned over, one at (" in kept.notes[-1]


def test_rows_follow_the_other_curvature_where_triangles_stay_turned_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lattice_rows, "unfolded", lambda pieces, surface: pieces)
    found = principal_triangles(*ellipsoid(LONG), count=400)
    assert turned(found, LONG) == 0
    assert any("rows follow the larger curvature" in note for note in found.notes)
    assert found.report["singular"] == {"0.5": 4}
    assert found.report["angle_mean_degrees"] < 1
    along = found.vertices[found.topology.edges[found.principal.mask]]
    step = torch.nn.functional.normalize(along[:, 1] - along[:, 0], dim=1)[along.mean(1)[:, 0].abs() < 0.5]
    assert (step[:, 0].abs() < 0.3).all()  # around the long axis


def test_other_counts_are_tried_where_triangles_stay_turned_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """With rows along either curvature; the first that has none is taken, and said."""
    numbers = [2, 3, 1, 1, 0]
    monkeypatch.setattr(lattice_rows, "turned_over", lambda *_: torch.arange(numbers.pop(0)))
    found = principal_triangles(*ellipsoid(HALF_LONG), count=200)
    assert numbers == []
    assert found.notes == ["7% fewer faces: as asked for, 2 triangles are turned over"]


def test_counts_that_are_too_far_off_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = [2, 3, 0, 0, 0, 0, 0, 0, 0, 0]
    monkeypatch.setattr(lattice_rows, "turned_over", lambda *_: torch.arange(numbers.pop(0)))
    monkeypatch.setattr(lattice_rows.RowLattice, "_off", lambda self, made: 0.151 if made.words else 0.0)
    found = principal_triangles(*ellipsoid(HALF_LONG), count=200)
    assert numbers == []  # all of them were tried
    assert len(found.notes) == 1
    assert found.notes[0].startswith("2 triangles are turned over")


def test_where_as_many_stay_turned_over_nothing_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = ellipsoid(HALF_LONG)
    given, surface = (
        pieces_of(vertices, topology.triangles.tolist()),
        read_surface(vertices, topology, MeshingSettings()),
    )
    monkeypatch.setattr(unfolding, "turned_over", lambda *_: torch.tensor([5]))
    assert unfolded(given, surface) is given


def inner_valences(mesh: TriangleMesh) -> list[int]:
    return mesh.topology.valences.sort().values.tolist()


def pieces_of(vertices: Tensor, faces: list[list[int]], rows: set[tuple[int, int]] | None = None) -> Pieces:
    creases = MeshCreases(torch.zeros(0, 2, dtype=torch.int64), torch.zeros(0, 2, 3))
    none = torch.zeros(0, 3, dtype=torch.float64)
    return Pieces(vertices.numpy(), faces, rows or set(), creases, none, none[:, 0], [], [0], [len(vertices)], None)


def test_corners_of_triangles_that_are_turned_over_move_until_there_are_none() -> None:
    """On the triangles of the surface; those far away stay, and so does the boundary."""
    vertices, topology = ellipsoid(HALF_LONG)
    surface = read_surface(vertices, topology, MeshingSettings())
    vertex, other = topology.edges[0].tolist()
    far = vertices.clone()
    far[vertex] = vertices[other] + 0.7 * (vertices[other] - vertices[vertex])
    far = surface.reference.closest(far).positions
    given = pieces_of(far, topology.triangles.tolist())
    assert len(turned_over(given, surface)) > 0
    found = unfolded(given, surface)
    assert len(turned_over(found, surface)) == 0
    moved = (torch.from_numpy(found.positions) != far).any(1)
    assert moved[vertex]
    assert moved.sum() < 30
    assert float(surface.reference.closest(torch.from_numpy(found.positions)).distances.max()) < 1e-12
    same = pieces_of(vertices, topology.triangles.tolist())
    assert unfolded(same, surface) is same


def test_the_note_counts_triangles_of_the_mesh_that_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rows along the other curvature turn over more."""
    numbers = [2, 3]
    monkeypatch.setattr(lattice_rows, "turned_over", lambda *_: torch.arange(numbers.pop(0) if numbers else 4))
    found = principal_triangles(*ellipsoid(HALF_LONG), count=200)
    assert "2 triangles are turned over, one at (" in found.notes[-1]
    assert not any("rows follow" in note or "faces:" in note for note in found.notes)


def test_faces_that_look_inward_are_turned_over() -> None:
    vertices, topology = ellipsoid(HALF_LONG)
    surface = read_surface(vertices, topology, MeshingSettings())

    def found(corners: list[list[int]]) -> list[int]:
        return turned_over(pieces_of(vertices, corners), surface).tolist()

    assert found(topology.triangles.tolist()) == []
    inward = [face[::-1] for face in topology.triangles.tolist()]
    assert len(found(inward)) == len(inward)


@pytest.mark.parametrize(
    ("height", "tip", "crease", "over"),
    [
        (0.2, 1.0, False, [1]),  # folded by 169 degrees
        (0.2, 1.0, True, []),
        (0.2, -1.0, False, []),  # one beside the other
        (1.0, 1.0, False, [1]),  # by 135 degrees
        (1.0, 0.5, False, []),  # by 117 degrees
    ],
)
def test_one_normal_is_enough_for_faces_that_are_folded(
    height: float, tip: float, crease: bool, over: list[int]
) -> None:
    """The second face looks along the smooth normal, not along that of the triangle beside it."""
    vertices = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0.5, 0], [tip, 0.5, height]], dtype=torch.float64)
    faces = [[0, 2, 1], [0, 1, 3]]
    own = face_normals(vertices, Topology.from_faces(faces))
    nearest = SimpleNamespace(normals=own * torch.tensor([[1.0], [-1.0]]), smooth_normals=own)
    surface = cast(ReadSurface, SimpleNamespace(reference=SimpleNamespace(closest=lambda points: nearest)))
    given = pieces_of(vertices, faces)
    if crease:
        given = replace(given, creases=MeshCreases(torch.tensor([[1, 0]]), torch.zeros(1, 2, 3)))
    assert turned_over(given, surface).tolist() == over
