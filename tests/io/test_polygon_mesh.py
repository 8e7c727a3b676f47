"""Meshes from the arrays of other programs, and back."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from torchfair import MeshError, PolygonMesh, ShapeError
from torchfair.shapes import hybrid_roof

SQUARE = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_a_mesh_goes_out_and_comes_back_to_the_bit() -> None:
    vertices, topology = hybrid_roof()
    points, corners, offsets = PolygonMesh(vertices, topology).to_arrays()
    assert (points.dtype, corners.dtype, offsets.dtype) == (np.float64, np.int64, np.int64)
    again, same = PolygonMesh.from_arrays(points, corners, offsets)
    assert again.equal(vertices)
    assert same.face_lists() == topology.face_lists()
    assert set(map(len, same.face_lists())) == {3, 4}  # or packing was not tried


def test_arrays_are_copies_both_ways() -> None:
    points, corners = np.array(SQUARE), np.array([0, 1, 2, 3])
    mesh = PolygonMesh.from_arrays(points, corners, [0, 4])
    points[:], corners[:] = 7, 0
    mesh.to_arrays()[0][:] = 7
    mesh.to_arrays()[1][:] = 0
    assert mesh.vertices.tolist() == SQUARE
    assert mesh.topology.face_lists() == [[0, 1, 2, 3]]


@pytest.mark.parametrize("kind", [list, np.array, torch.tensor])
def test_arrays_of_any_kind(kind: type) -> None:
    mesh = PolygonMesh.from_arrays(kind(SQUARE), kind([0, 1, 2, 0, 2, 3]), kind([0, 3, 6]))
    assert mesh.topology.face_lists() == [[0, 1, 2], [0, 2, 3]]
    assert PolygonMesh.from_arrays(kind(SQUARE), kind([[0, 1, 2], [0, 2, 3]])).topology.num_interior_edges == 1


def test_unused_vertices_stay() -> None:
    assert PolygonMesh.from_arrays([*SQUARE, [9, 9, 9]], [0, 1, 2, 3], [0, 4]).topology.num_vertices == 5


@pytest.mark.parametrize("offsets", [[0, 3], [1, 4], [], [0, 5, 4], [0, 5]])
def test_offsets_that_do_not_fit_are_refused(offsets: list[int]) -> None:
    with pytest.raises(MeshError, match="offsets must"):
        PolygonMesh.from_arrays(SQUARE, [0, 1, 2, 3], offsets)


def test_other_mistakes_are_named() -> None:
    with pytest.raises(ShapeError, match=r"points: expected numbers \(V, 3\), got \(4, 2\)"):
        PolygonMesh.from_arrays(np.zeros((4, 2)), [0, 1, 2, 3], [0, 4])
    with pytest.raises(MeshError, match="corners must be one row of whole numbers, got float64"):
        PolygonMesh.from_arrays(SQUARE, [0.0, 1, 2, 3], [0, 4])
    with pytest.raises(MeshError):
        PolygonMesh.from_arrays(SQUARE, [0, 1, 2, 4], [0, 4])


@given(st.lists(st.integers(3, 7), min_size=1, max_size=5))
def test_packing_is_that_of_face_lists(sizes: list[int]) -> None:
    starts = np.concatenate([[0], np.cumsum(sizes)])
    corners = np.arange(starts[-1])
    points = np.random.default_rng(0).normal(size=(starts[-1], 3))
    mesh = PolygonMesh.from_arrays(points, corners, starts)
    assert mesh.topology.face_lists() == [corners[a:b].tolist() for a, b in itertools.pairwise(starts)]
