"""Collapses and merges that leave a manifold, and those that are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers import grid_faces, random_rotation

from torchfair import Topology
from torchfair.meshing.boundary_cells import compact, tidy_boundary
from torchfair.meshing.polygon_area import area_vector, area_vectors
from torchfair.meshing.polygon_edits import PolygonEdits
from torchfair.meshing.polygon_sides import sides_cross
from torchfair.meshing.tracing import Cells

NO_CREASES = np.zeros((0, 2), np.int64)


def grid(rows: int = 4, columns: int = 4) -> tuple[np.ndarray, list[list[int]], np.ndarray]:
    """Positions, quads, and which vertices are on the boundary."""
    x, y = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    outer = (x == 0) | (y == 0) | (x == rows - 1) | (y == columns - 1)
    positions = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1).astype(float)
    return positions, grid_faces(rows, columns).tolist(), outer.ravel()


def edits(rows: int = 4, columns: int = 4, fixed: tuple[int, ...] = ()) -> PolygonEdits:
    positions, faces, outer = grid(rows, columns)
    keep = np.zeros(len(positions), bool)
    keep[list(fixed)] = True
    return PolygonEdits(positions, faces, outer, keep)


def test_area_vectors_of_all_faces_are_those_of_each_also_far_away() -> None:
    random = np.random.default_rng(0)
    positions = random.normal(size=(40, 3)) + 1e6
    faces = [random.permutation(40)[:size].tolist() for size in (3, 7, 4, 4, 5, 3)]
    each = np.array([area_vector(positions, face) for face in faces])
    assert np.abs(area_vectors(positions, faces) - each).max() < 1e-12
    assert np.abs(area_vectors(positions, faces[:1]) - each[:1]).max() < 1e-12
    assert area_vectors(positions, []).shape == (0, 3)


def test_areas_of_all_faces_are_those_of_each() -> None:
    """Also once they were changed, over what differs from node to node; 0 without a normal."""
    found = edits()
    assert found.collapse((5, 1))
    assert found.collapse((6, 2))
    found.positions[:, 2] = np.sin(5 * found.positions[:, 0])
    found.normals[4] = np.zeros(3)
    full = np.linspace(1, 2, len(found.positions))
    each = [found.area(number) / full[face].min() for number, face in found.faces.items()]
    assert len(set(map(len, found.faces.values()))) > 1
    np.testing.assert_allclose(found.areas_over(full), each, rtol=1e-12)


def is_disk(of: PolygonEdits) -> bool:
    whole = compact(of)
    topology = Topology.from_faces(whole.faces, len(whole.positions))
    return topology.num_vertices - topology.num_edges + topology.num_faces == 1


def test_a_collapse_ends_on_the_boundary() -> None:
    found = edits()
    assert found.collapse((5, 1))
    assert 5 not in found.around
    assert found.positions[1].tolist() == [0, 1, 0]
    assert is_disk(found)
    assert found.place_of(5) == 1
    assert compact(found).number[5] == compact(found).number[1] >= 0
    assert sorted(map(len, found.faces.values())).count(3) == 2


def test_fixed_nodes_stay() -> None:
    found = edits(fixed=(5, 9))
    assert not found.collapse((5, 9))
    assert found.collapse((5, 6))
    assert 5 in found.around
    assert 6 not in found.around


def test_a_surface_is_not_pinched() -> None:
    """An inner edge between two boundary nodes: its collapse would leave two parts that touch in a point."""
    found = edits(3, 2)
    before = {number: list(face) for number, face in found.faces.items()}
    assert not found.collapse((2, 3))
    assert found.faces == before
    assert found.collapse((0, 1))
    assert is_disk(found)


def test_the_last_face_does_not_vanish() -> None:
    found = PolygonEdits(np.eye(3), [[0, 1, 2]], np.ones(3, bool), np.zeros(3, bool))
    assert not found.collapse((0, 1))
    assert found.faces == {0: [0, 1, 2]}


def test_faces_are_not_turned_over() -> None:
    found = edits()
    found.positions[5] = [2.5, 0.4, 0]  # folded beforehand: collapsing another edge must not count that as its side
    found = PolygonEdits(found.positions, list(found.faces.values()), found.on_curve, found.fixed)
    start = {number: found.area(number) for number in found.faces}
    found.collapse((6, 10))
    assert all(found.area(number) > 0 or start[number] <= 0 for number in found.faces)


def test_merging() -> None:
    found = edits()
    assert found.across((0, 1), 0) is None
    edge = next(edge for edge in found.sides(0) if found.across(edge, 0) is not None)
    other = found.across(edge, 0)
    assert found.merge(0, edge)
    assert other not in found.faces
    assert len(found.faces[0]) == 6
    assert found.area(0) == pytest.approx(2)
    assert is_disk(found)
    found.drop_straight_nodes(0)
    assert len(found.faces[0]) < 6  # corners of the grid that are used by this face only
    assert is_disk(found)


def test_collapses_that_turn_edges_too_far_are_refused() -> None:
    """A row 0.2 from the boundary: edges across are not turned by a collapse, those along it by 11.3 degrees."""
    positions, faces, outer = grid()
    positions[4:8, 0] = 0.2
    found = PolygonEdits(positions, faces, outer, np.zeros(16, bool))
    assert not found.collapse((5, 1), math.radians(11.2))
    assert found.faces == dict(enumerate(faces))
    assert found.collapse((5, 1), math.radians(11.4))
    assert found.directions.turn(1, 6, 6) == pytest.approx(math.atan(0.2))  # seen from the first direction
    assert found.directions.turn(1, 6, 2) == pytest.approx(0)


def test_of_two_ends_the_one_stays_for_which_less_turns() -> None:
    """Two lines end beside each other on the boundary; one is straight, if the other moves, twice as long."""
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1.1, 0, 0], [2, 0, 0], [2, 2, 0], [1.1, 2, 0], [1, 1, 0], [0, 1, 0]])
    faces = [[0, 1, 6, 7], [1, 2, 5, 6], [2, 3, 4, 5]]
    for order in ((1, 2), (2, 1)):
        found = PolygonEdits(positions, faces, np.arange(8) < 4, np.zeros(8, bool))
        assert found.collapse(order, math.radians(4))
        assert found.place_of(2) == 1


@pytest.mark.parametrize(("side", "stays"), [(0.25, True), (0.18, False), (0.32, True)])
def test_short_edges_stay_where_others_would_turn_by_too_much(side: float, stays: bool) -> None:
    """Squares around (1, 1), of the last of which the boundary leaves a triangle."""
    flat: list[list[float]] = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [1 + side, 1], [0, 2], [1, 2]]
    positions = np.array([[x, y, 0] for x, y in flat])
    faces = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 7]]
    outer, corner = np.arange(8) != 4, np.isin(np.arange(8), [0, 2, 6])
    cells = Cells(positions, faces, [[0, 1, 0, 1]] * 4, outer, corner, NO_CREASES)
    tidied = compact(tidy_boundary(cells, 1.0, 1.0, math.radians(5)))
    assert ([1, 1, 0] in tidied.positions.tolist()) == stays
    any_angle = compact(tidy_boundary(cells, 1.0, 1.0))
    assert ([1, 1, 0] in any_angle.positions.tolist()) == (side > 0.3)


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_slivers_and_short_edges_go(far: float) -> None:
    """A row of quads a hundredth as high as the others along the boundary."""
    positions, faces, outer = grid(5, 6)
    positions[positions[:, 1] == 5, 1] = 4.01
    positions = 0.01 * positions + far
    corner = np.isin(np.arange(len(positions)), [0, 24, 5, 29])
    on = [[0, 1, 0, 1] for _ in faces]
    cells = Cells(positions, faces, on, outer, corner, NO_CREASES)
    tidied, left, *_ = compact(tidy_boundary(cells, 0.01, 1e-4))
    topology = Topology.from_faces(left, len(tidied))
    assert topology.num_vertices - topology.num_edges + topology.num_faces == 1
    assert topology.num_faces == 16
    assert topology.is_quadrangular
    assert tidied[:, 1].max() == positions[:, 1].max()
    ends = tidied[topology.edges.numpy()]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min() > 0.003


def test_areas_do_not_depend_on_the_place() -> None:
    positions, faces, outer = grid()
    far = PolygonEdits(0.01 * positions + 1e6, faces, outer, np.zeros(len(positions), bool))
    assert [far.area(number) for number in far.faces] == pytest.approx([1e-4] * len(faces), rel=1e-6)


def test_bulges_over_one_line_are_dropped() -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    outer, corner = np.ones(4, bool), np.zeros(4, bool)
    cells = Cells(positions, [[0, 1, 2, 3], [1, 0]], [[0, 1, 0, 1], [2, 0]], outer, ~corner, NO_CREASES)
    assert compact(tidy_boundary(cells, 1.0, 1.0)).faces == [[0, 1, 2, 3]]


def test_a_collapse_that_makes_sides_cross_is_refused() -> None:
    """A cell with a bay: with the edge (1, 2) gone the side from 0 to 2 passes on the other side of 4."""
    positions = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [1.4, 2, 0], [1.4, 0.5, 0], [0, 2, 0]])
    outer = np.ones(6, bool)
    found = PolygonEdits(positions, [[0, 1, 2, 3, 4, 5]], outer, np.array([True, False, True, True, True, True]))
    assert area_vector(positions, [0, 2, 3, 4, 5])[2] > 0
    assert not found.collapse((1, 2))
    found.drop_straight_nodes(0)
    assert found.faces == {0: [0, 1, 2, 3, 4, 5]}
    shallow = positions.copy()
    shallow[4, 1] = 1.5
    found = PolygonEdits(shallow, [[0, 1, 2, 3, 4, 5]], outer, np.array([True, False, True, True, True, True]))
    assert found.collapse((1, 2))


def crosses(corners: np.ndarray) -> bool:
    """Naively, of a polygon in the plane: by shares along both sides."""
    count = len(corners)
    for i in range(count):
        for j in range(i + 2, count - (i == 0)):
            (a, b), (c, d) = (corners[[k, (k + 1) % count]] for k in (i, j))
            shares = np.linalg.solve(np.stack([b - a, c - d], 1), c - a)
            if (shares > 0).all() and (shares < 1).all():
                return True
    return False


def test_sides_that_cross_are_found() -> None:
    """As naively; in space, for both normals, wherever it begins; sides that only touch do not cross."""
    random, turn = np.random.default_rng(0), random_rotation(3).numpy()
    seen = []
    for size in (4, 5, 6, 7):
        for _ in range(40):
            flat = random.normal(size=(size, 2))
            seen.append(crosses(flat))
            space = np.roll(np.c_[flat, 0 * flat[:, 0]], random.integers(size), axis=0) @ turn.T
            assert [sides_cross(space, sign * turn[:, 2]) for sign in (1, -1)] == [seen[-1]] * 2
    assert 20 < sum(seen) < 140
    touching = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0, 0], [0, 2, 0]])
    assert not sides_cross(touching, np.array([0.0, 0, 1]))


def test_a_collapse_may_be_forbidden_to_sharpen_corners() -> None:
    """In a grid of quads it makes triangles, whose corners are sharper than right angles."""
    found = edits()
    before = {number: list(face) for number, face in found.faces.items()}
    assert not found.collapse((5, 6), may_sharpen=False)
    assert found.faces == before
    assert found.collapse((5, 6))
    fan = np.array([[0, 0, 0], [0.05, 0, 0], [0.5, 1, 0], [-1, 0, 0], [1.5, 0, 0]])
    needle = PolygonEdits(fan, [[0, 1, 2], [3, 0, 2], [1, 4, 2]], np.ones(5, bool), np.zeros(5, bool))
    assert needle.collapse((0, 1), may_sharpen=False)
