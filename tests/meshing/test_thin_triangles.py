"""Thin triangles at curves are shared out by flips, or collapsed; rows, creases and corners stay."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from torchfair import Topology
from torchfair.boundary import boundary_corners
from torchfair.geometry import face_areas
from torchfair.meshing import MeshingSettings, principal_triangles
from torchfair.meshing.boundary_cells import Compact
from torchfair.meshing.thin_triangles import rows_of, without_thin_triangles
from torchfair.meshing.tracing import Cells
from torchfair.shapes import PrincipalParaboloid, irregular_triangles

KITE = np.array([[0, 0, 0], [0.5, -0.02, 0], [1, 0, 0], [0.5, 1, 0]], float)
"""With 1 nearly on the side 0 2 of the triangle 0 2 3."""


def thinned(
    *, row: bool = False, crease: bool = False, fixed: tuple[int, ...] = (0, 2, 3), boundary: bool = True
) -> Compact:
    """What becomes of the two triangles of the kite."""
    faces, on = [[0, 1, 2], [0, 2, 3]], [[2, 2, int(row)], [int(row), 2, 2]]
    marks = np.zeros(4, bool)
    marks[list(fixed)] = True
    creases = np.array([[0, 2]] if crease else [], np.int64).reshape(-1, 2)
    on_boundary = np.full(4, boundary)
    cells = Cells(KITE, faces, on, on_boundary, marks, creases)
    return without_thin_triangles(cells, Compact(KITE, faces, np.arange(4), creases))


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
    assert len(found.positions) == 3
    assert found.number[1] in (found.number[0], found.number[2])
    assert sets(found.faces) == {frozenset(found.number[[0, 2, 3]].tolist())}


def test_corners_stay_even_if_a_thin_triangle_does() -> None:
    found = thinned(row=True, fixed=(0, 1, 2, 3))
    assert found.faces == [[0, 1, 2], [0, 2, 3]]
    assert found.number.tolist() == [0, 1, 2, 3]


def test_no_edge_is_made_twice_by_a_flip() -> None:
    """Another pair of triangles, below, has the edge that the flip would make."""
    positions = np.vstack([KITE, [[0.6, -1, 0.5], [0.4, -1, -0.5]]])
    faces = [[0, 1, 2], [0, 2, 3], [1, 3, 4], [3, 1, 5]]
    on = [[0, 0, 0]] * 4
    none, every = np.zeros((0, 2), np.int64), np.ones(6, bool)
    cells = Cells(positions, faces, on, every, every, none)
    assert without_thin_triangles(cells, Compact(positions, faces, np.arange(6), none)).faces == faces


def test_the_flip_that_leaves_the_smaller_triangle_largest_is_made() -> None:
    """Both sides of the thin triangle 0 1 2 may be flipped: beyond 0 2 lies 3, beyond 1 2 lies 4."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [1.2, 0.015, 0], [0.3, 1, 0], [4, 0.027, 0]], float)
    for turn in range(3):
        thin = np.roll([0, 1, 2], turn).tolist()
        faces = [thin, [0, 2, 3], [2, 1, 4]]
        none, every = np.zeros((0, 2), np.int64), np.ones(5, bool)
        cells = Cells(positions, faces, [[0, 0, 0]] * 3, every, every, none)
        found = without_thin_triangles(cells, Compact(positions, faces, np.arange(5), none)).faces
        assert frozenset({0, 1, 3}) in sets(found)
        assert frozenset({1, 2, 3}) in sets(found)


def test_only_triangles_at_curves_are_looked_at() -> None:
    """Creases are some."""
    assert thinned(boundary=False).faces == [[0, 1, 2], [0, 2, 3]]
    assert len(thinned(boundary=False, crease=True).faces) == 1


def test_rows_are_sides_of_cells_on_lines_of_the_second_coordinate() -> None:
    """By the vertices that nodes have become, without those that are gone."""
    none, no = np.zeros((0, 2), np.int64), np.zeros(4, bool)
    cells = Cells(KITE, [[0, 1, 2], [0, 2, 3]], [[1, 0, 1], [1, 2, 1]], ~no, no, none)
    whole = Compact(KITE, [], np.array([0, 0, 1, -1]), none)
    assert rows_of(cells, whole) == {(0, 1)}


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
