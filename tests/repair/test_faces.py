"""Faces that are no faces: repeated corners, faces that occur twice, faces without area."""

from __future__ import annotations

import torch
from helpers import wavy_grid

from torchfair.repair import repair_mesh

SQUARE = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], dtype=torch.float64)


def test_repeated_corners_are_dropped_and_told() -> None:
    result = repair_mesh(SQUARE, [[0, 1, 2, 2], [0, 2, 3], [1, 1, 2], [1, 4, 2, 4]])
    assert result.faces == [[0, 1, 2], [0, 2, 3]]
    assert result.kept_faces.tolist() == [0, 1]
    assert result.kept_corners.tolist() == [0, 1, 2, 4, 5, 6]
    assert result.messages[:2] == [
        "dropped repeated corners of 1 face(s): faces 0.",
        "dropped 2 face(s) with fewer than three different corners: faces 2, 3.",
    ]


def test_a_face_that_touches_itself_becomes_two() -> None:
    """0 1 2 0 3 4 are two triangles that share a vertex, which then has a copy for each of them."""
    result = repair_mesh(torch.rand(5, 3, dtype=torch.float64), [[0, 1, 2, 0, 3, 4]])
    assert result.topology.face_sizes.tolist() == [3, 3]
    assert result.kept_faces.tolist() == [0, 0]
    assert result.kept_vertices.tolist() == [0, 1, 2, 3, 4, 0]


def test_faces_that_occur_twice_are_left_once() -> None:
    faces = [[0, 1, 2], [0, 2, 3], [2, 0, 1], [3, 2, 0]]
    result = repair_mesh(SQUARE[:4], faces)
    assert result.faces == faces[:2]
    assert result.messages == ["dropped 2 face(s) that occur twice: faces 2 like 0, 3 like 1."]


def test_an_opposite_double_goes_where_it_hangs_on_others_and_stays_where_it_closes() -> None:
    assert repair_mesh(SQUARE[:4], [[0, 1, 2], [0, 2, 3], [0, 3, 2]]).faces == [[0, 1, 2], [0, 2, 3]]
    assert repair_mesh(SQUARE[:3], [[0, 1, 2], [0, 2, 1]]).faces == [[0, 1, 2], [0, 2, 1]]


def test_faces_without_area_go_and_their_neighbours_stay_joined() -> None:
    """A needle between two triangles: its long edge takes in the vertex on it, and nothing is open inside."""
    points = torch.tensor([[0.0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0], [1, -1, 0]], dtype=torch.float64)
    result = repair_mesh(points, [[0, 2, 3], [2, 1, 3], [0, 1, 2], [1, 0, 4]])
    assert result.kept_faces.tolist() == [0, 1, 3]
    assert result.faces == [[0, 2, 3], [2, 1, 3], [1, 2, 0, 4]]
    assert result.kept_corners[-4:].tolist() == [9, -1, 10, 11]
    assert len(result.topology.boundary_loops()) == 1
    assert result.messages == [
        "dropped 1 face(s) without area: faces 2.",
        "put 1 vertex(es) of T-junctions into the edges on which they lie: vertices 2; faces 3.",
    ]


def test_an_edge_of_length_zero_is_taken_together() -> None:
    points = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [2, 0, 1]], dtype=torch.float64)
    result = repair_mesh(points, [[0, 1, 3], [1, 2, 3], [2, 4, 3]])
    assert result.faces == [[0, 1, 2], [1, 3, 2]]
    assert result.vertex_map.tolist() == [0, 1, 1, 2, 3]
    assert result.topology.num_interior_edges == 1
    assert result.messages == [
        "merged the ends of 1 edge(s) of length zero: vertices 1 and 2.",
        "dropped 1 face(s) with fewer than three different corners: faces 1.",
    ]


def test_long_lists_are_cut() -> None:
    vertices, topology = wavy_grid(10, 10)
    (message,) = repair_mesh(vertices, topology.face_lists() * 2).messages
    assert message == (
        "dropped 81 face(s) that occur twice: faces 81 like 0, 82 like 1, 83 like 2, 84 like 3, 85 like 4 and 76 more."
    )
