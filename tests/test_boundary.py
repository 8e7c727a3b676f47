"""Corners of the boundary are where it turns; pieces run between them and cover every loop once."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.boundary import boundary_corners, boundary_pieces, boundary_turning


def square_grid(rows: int = 5, columns: int = 4) -> tuple[Tensor, Topology]:
    x, y = np.meshgrid(np.arange(float(rows)), np.arange(float(columns)), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    return torch.from_numpy(points), Topology.from_faces(grid_faces(rows, columns))


def polygon(points: list[list[float]]) -> tuple[Tensor, Topology]:
    return torch.tensor(points, dtype=DOUBLE), Topology.from_faces([range(len(points))])


def annulus() -> Topology:
    """A ring of eight quads; the loops are 0..7 outside and 8..15 inside."""
    return Topology.from_faces([[k, (k + 1) % 8, 8 + (k + 1) % 8, 8 + k] for k in range(8)])


def test_a_rectangular_grid_has_four_corners_and_four_sides():
    vertices, topology = square_grid()
    corners = boundary_corners(vertices, topology, math.radians(45))
    assert corners.nonzero().squeeze(1).tolist() == [0, 3, 16, 19]
    pieces = boundary_pieces(topology, corners)
    assert [piece.vertices.tolist() for piece in pieces] == [
        [0, 4, 8, 12, 16],
        [16, 17, 18, 19],
        [19, 15, 11, 7, 3],
        [3, 2, 1, 0],
    ]
    assert not any(closed for _, closed in pieces)


def test_a_circle_of_thirty_vertices_has_no_corner_and_one_closed_piece():
    angles = torch.arange(30, dtype=DOUBLE) * (math.pi / 15)
    vertices = torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], dim=1)
    topology = Topology.from_faces([range(30)])
    corners = boundary_corners(vertices, topology, math.radians(45))
    assert not corners.any()
    ((loop, closed),) = boundary_pieces(topology, corners)
    assert closed
    assert torch.equal(loop, topology.boundary_loops()[0])
    # It turns by 12 degrees everywhere.
    assert boundary_corners(vertices, topology, math.radians(11.99)).all()
    assert not boundary_corners(vertices, topology, math.radians(12.01)).any()
    torch.testing.assert_close(boundary_turning(vertices, topology), torch.full((30,), math.pi / 15, dtype=DOUBLE))


@pytest.mark.parametrize("turning", [0.0, 20.0, 80.0, 100.0, 135.0, 179.0])
def test_the_angle_is_the_one_between_consecutive_edges_whichever_way_it_turns(turning):
    angle = math.radians(turning)
    for sign in (1, -1):
        tip = [2 + math.cos(angle), sign * math.sin(angle), 0]
        vertices, topology = polygon([[0.0, 0, 0], [2, 0, 0], tip, [1, sign * 5, 3]])
        vertices = vertices @ random_rotation(2).T + 10
        assert not boundary_corners(vertices, topology, min(angle + 1e-9, math.pi))[1]
        if turning:
            assert boundary_corners(vertices, topology, angle - 1e-9)[1]


def test_corners_do_not_depend_on_scale_and_batches_are_loops():
    vertices, topology = square_grid()
    bent = vertices + 0.5 * torch.randn(3, *vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    corners = boundary_corners(bent, topology, 0.8)
    assert corners.any()
    assert not corners.all()
    assert torch.equal(corners, torch.stack([boundary_corners(one, topology, 0.8) for one in bent]))
    assert torch.equal(corners, boundary_corners(bent.float() * 1e-6, topology, 0.8))
    assert not corners[:, ~topology.is_boundary_vertex].any()


def test_a_boundary_that_runs_back_is_a_corner_and_an_edge_without_length_is_not():
    back, topology = polygon([[0.0, 0, 0], [2, 0, 0], [1, 0, 0], [0.5, 1, 0]])
    assert boundary_corners(back, topology, 3.14)[1]
    double, topology = polygon([[0.0, 0, 0], [2, 0, 0], [2, 0, 0], [2, 3, 0]])
    assert boundary_corners(double, topology, 0.1).tolist() == [True, False, False, True]


def test_closed_surfaces_and_isolated_vertices_have_no_corners():
    vertices, topology = cube()
    assert not boundary_corners(vertices, topology, 0.0).any()
    assert boundary_pieces(topology, torch.ones(8, dtype=torch.bool)) == []
    triangle = Topology.from_faces([[0, 1, 2]], 4)
    vertices = torch.eye(4, 3, dtype=DOUBLE)
    assert boundary_corners(vertices, triangle, 1.0).tolist() == [True, True, True, False]


@settings(deadline=None)  # a loaded machine is no failure
@given(st.sets(st.integers(0, 15)))
def test_pieces_cover_every_boundary_edge_once_and_start_and_end_at_corners(chosen):
    topology = annulus()
    corners = torch.zeros(16, dtype=torch.bool)
    corners[list(chosen)] = True
    edges = []
    for vertices, closed in boundary_pieces(topology, corners):
        marked = corners[vertices].tolist()
        if closed:
            assert not any(marked)
            edges += zip(vertices.tolist(), vertices.roll(-1).tolist(), strict=True)
        else:
            assert marked == [True, *[False] * (len(marked) - 2), True]
            edges += zip(vertices.tolist()[:-1], vertices.tolist()[1:], strict=True)
    assert sorted(edges) == sorted(map(tuple, topology.boundary_edges.tolist()))


def test_one_corner_makes_one_open_piece_from_it_to_itself():
    corners = torch.zeros(16, dtype=torch.bool)
    corners[3] = True
    (outer, outer_closed), (_, inner_closed) = boundary_pieces(annulus(), corners)
    assert outer.tolist() == [3, 4, 5, 6, 7, 0, 1, 2, 3]
    assert (outer_closed, inner_closed) == (False, True)


def test_wrong_input_is_refused():
    vertices, topology = square_grid()
    for angle in (45.0, -0.1, math.nan):
        with pytest.raises(ValueError, match=r"radians between 0 and pi.*math\.radians"):
            boundary_corners(vertices, topology, angle)
    with pytest.raises(ShapeError, match="vertices"):
        boundary_corners(vertices[1:], topology, 0.5)
    for corners in (torch.zeros(20), torch.zeros(19, dtype=torch.bool), [False] * 20):
        with pytest.raises(ShapeError, match="corners"):
            boundary_pieces(topology, corners)
