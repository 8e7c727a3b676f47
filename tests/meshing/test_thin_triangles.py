"""Thin triangles at curves are shared out by flips, or collapsed; rows, creases and corners stay."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from torchfair import Topology
from torchfair.boundary import boundary_corners
from torchfair.geometry import face_areas
from torchfair.meshing import MeshingSettings, principal_triangles, thin_triangles
from torchfair.meshing.components import Pieces
from torchfair.meshing.mesh_creases import MeshCreases
from torchfair.meshing.thin_triangles import thickened, without_thin_triangles
from torchfair.shapes import PrincipalParaboloid, irregular_triangles

KITE = np.array([[0, 0, 0], [0.5, -0.02, 0], [1, 0, 0], [0.5, 1, 0]], float)
"""With 1 nearly on the side 0 2 of the triangle 0 2 3."""


def pieces(
    positions: np.ndarray,
    faces: list[list[int]],
    rows: set[tuple[int, int]] | None = None,
    creases: list[list[int]] | None = None,
) -> Pieces:
    """Triangles as one component."""
    lines = MeshCreases(torch.tensor(creases or []).long().view(-1, 2), torch.zeros(0, 2, 3, dtype=torch.float64))
    none = torch.zeros(0, dtype=torch.float64)
    return Pieces(positions, faces, rows or set(), lines, none.view(0, 3), none, [], [0], [len(positions)], None)


def thinned(*, row: bool = False, crease: bool = False, fixed: tuple[int, ...] = (0, 2, 3)) -> Pieces:
    """What becomes of the two triangles of the kite."""
    kept = np.zeros(4, bool)
    kept[list(fixed)] = True
    kite = pieces(KITE, [[0, 1, 2], [0, 2, 3]], {(0, 2)} if row else None, [[0, 2]] if crease else None)
    return thickened(kite, kept)


def sets(faces: list[list[int]]) -> set[frozenset[int]]:
    return set(map(frozenset, faces))


def test_the_side_of_a_thin_triangle_is_flipped() -> None:
    found = thinned()
    assert sets(found.faces) == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}
    areas = face_areas(torch.from_numpy(found.positions), Topology.from_faces(found.faces))
    assert float(areas.min()) == pytest.approx(0.255, rel=0.01)
    normals = np.cross(*(np.diff(found.positions[found.faces], axis=1).transpose(1, 0, 2)))
    assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("kept", ["row", "crease"])
def test_an_edge_that_has_to_stay_is_not_flipped_and_the_triangle_collapses(kept: str) -> None:
    found = thinned(**{kept: True})  # type: ignore[arg-type]
    assert found.counts == [3]
    np.testing.assert_array_equal(found.positions, KITE[[0, 2, 3]])
    assert sets(found.faces) == {frozenset({0, 1, 2})}
    assert found.rows == ({(0, 1)} if kept == "row" else set())
    assert found.creases.edges.tolist() == ([[0, 1]] if kept == "crease" else [])


def test_corners_stay_even_if_a_thin_triangle_does() -> None:
    found = thinned(row=True, fixed=(0, 1, 2, 3))
    assert found.faces == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_array_equal(found.positions, KITE)


def test_no_edge_is_made_twice_by_a_flip() -> None:
    """A third triangle has the edge that the flip would make."""
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1]]
    assert thickened(pieces(KITE, faces), np.ones(4, bool)).faces == faces


def test_the_flip_that_leaves_the_smaller_triangle_largest_is_made() -> None:
    """Both sides of the thin triangle 0 1 2 may be flipped: beyond 0 2 lies 3, beyond 1 2 lies 4."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [1.2, 0.015, 0], [0.3, 1, 0], [4, 0.027, 0]])
    for turn in range(3):
        thin = np.roll([0, 1, 2], turn).tolist()
        found = sets(thickened(pieces(positions, [thin, [0, 2, 3], [2, 1, 4]]), np.ones(5, bool)).faces)
        assert frozenset({0, 1, 3}) in found
        assert frozenset({1, 2, 3}) in found


def test_only_triangles_at_curves_are_looked_at() -> None:
    """Around a thin pair inside a hexagon of triangles nothing changes; with a crease on it something does."""
    around = [[np.cos(a), np.sin(a), 0.0] for a in np.arange(6) * np.pi / 3]
    outer = [[2 * x, 2 * y, 0.0] for x, y, _ in around]
    positions = np.array([*around, *outer, [0.0, 0.02, 0], [0.05, -0.02, 0]])
    inside = [[0, 1, 12], [1, 2, 12], [2, 3, 12], [3, 4, 12], [4, 13, 12], [4, 5, 13], [5, 0, 13], [0, 12, 13]]
    ring = [of for k in range(6) for of in ([k, 6 + k, 6 + (k + 1) % 6], [k, 6 + (k + 1) % 6, (k + 1) % 6])]
    fixed = np.arange(14) < 12
    assert thickened(found := pieces(positions, [*inside, *ring]), fixed) is found
    creased = pieces(positions, [*inside, *ring], creases=[[3, 12], [0, 12]])
    assert len(thickened(creased, fixed | (np.arange(14) == 12)).positions) == 13


def test_components_keep_their_vertices() -> None:
    """Two kites of which one loses a vertex."""
    both = replace(
        pieces(np.vstack([KITE, KITE + 5]), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], {(4, 6)}), counts=[4, 4]
    )
    found = thickened(both, np.arange(8) % 4 != 1)
    assert found.counts == [4, 3]
    assert sets(found.faces) == {frozenset({0, 1, 3}), frozenset({1, 2, 3}), frozenset({4, 5, 6})}
    assert found.rows == {(4, 5)}


def test_a_corner_does_not_become_sharper() -> None:
    """Where the flip would, nothing changes."""
    positions = np.array([[0, 0, 0], [0.5, -0.02, 0], [1, 0, 0], [0.5, 30, 0]])
    for far, flips in ((30.0, False), (1.0, True)):
        positions[3, 1] = far
        found = thickened(pieces(positions, [[0, 1, 2], [0, 2, 3]]), np.ones(4, bool))
        assert (frozenset({0, 1, 3}) in sets(found.faces)) == flips


@pytest.mark.parametrize("worse", ["turned_over", "_exceptions"])
def test_nothing_changes_where_faces_would_be_turned_over_or_rows_lost(
    worse: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    kite, kept = pieces(KITE, [[0, 1, 2], [0, 2, 3]]), np.ones(4, bool)
    nowhere: Any = None
    measures = {"turned_over": lambda of, surface: range(of is not kite), "_exceptions": lambda of: int(of is not kite)}
    fine = {"turned_over": lambda of, surface: range(3), "_exceptions": lambda of: 3}
    for name, measure in {**fine, worse: measures[worse]}.items():
        monkeypatch.setattr(thin_triangles, name, measure)
    assert without_thin_triangles(kite, nowhere, kept) is kite
    monkeypatch.setattr(thin_triangles, worse, fine[worse])
    assert sets(without_thin_triangles(kite, nowhere, kept).faces) == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}


@pytest.mark.parametrize(("seed", "count"), [(0, 600), (1, 330), (2, 600), (3, 420)])
def test_no_triangle_at_the_rim_is_a_sliver_and_rows_and_corners_are_whole(seed: int, count: int) -> None:
    """On a piece of a saddle whose rim crosses the lines at all angles."""
    whole = irregular_triangles(PrincipalParaboloid(0.7, -0.5), 1600, seed=seed)
    x, y, _ = whole.vertices.T
    inside = (x.square() + y.square() < 0.8) & ((x - 0.3).square() + (y - 0.2).square() > 0.06)
    faces = whole.topology.corners.view(-1, 3)
    faces = faces[inside[faces].all(1)]
    used, corners = torch.unique(faces, return_inverse=True)
    vertices, topology = whole.vertices[used], Topology.from_faces(corners, len(used))
    mesh = principal_triangles(vertices, topology, count=count)
    assert mesh.report["smallest_curve_face"] >= 0.05
    rows = mesh.principal.mask[: mesh.topology.num_interior_edges]
    assert 0.25 < float(rows.double().mean()) < 0.4
    rim = vertices[boundary_corners(vertices, topology, MeshingSettings().corner_angle)]
    assert len(rim) > 3
    assert float((rim[:, None] - mesh.vertices).norm(dim=2).amin(1).max()) < 1e-9
