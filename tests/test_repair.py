"""Repair turns over as few faces as possible, drops unused vertices, and leaves alone what is right."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from helpers import cube, grid_faces, split_quads, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair import MeshError, ShapeError, Topology
from torchfair.repair import repair_mesh


def turn_over(faces: list[list[int]], which: set[int]) -> list[list[int]]:
    """``faces`` with some turned over; their first corner stays the first."""
    return [face[:1] + face[:0:-1] if i in which else face for i, face in enumerate(faces)]


def moebius_faces(size: int) -> list[list[int]]:
    """A strip of quads, closed with a half turn."""
    top = [*range(size), size]
    bottom = [*range(size, 2 * size), 0]
    return [[top[i], bottom[i], bottom[i + 1], top[i + 1]] for i in range(size)]


def test_a_good_mesh_stays_as_it_is() -> None:
    vertices, topology = wavy_grid()
    result = repair_mesh(vertices, topology.face_lists())
    assert torch.equal(result.vertices, vertices)
    assert result.faces == topology.face_lists()
    assert result.messages == []
    assert result.flipped_faces.numel() == 0
    assert result.kept_vertices.tolist() == list(range(topology.num_vertices))


@settings(max_examples=40, deadline=None)
@given(st.sets(st.integers(0, 11), max_size=5))
def test_the_minority_is_turned_over(which: set[int]) -> None:
    faces = grid_faces(4, 5).tolist()
    result = repair_mesh(torch.zeros(20, 3), turn_over(faces, which))
    assert result.faces == faces
    assert result.flipped_faces.tolist() == sorted(which)
    assert bool(result.messages) == bool(which)


def test_an_even_split_keeps_the_lowest_face() -> None:
    for which in ({0}, {1}):
        given_faces = turn_over([[0, 1, 2], [1, 0, 3]], which)
        result = repair_mesh(torch.zeros(4, 3), given_faces)
        assert result.flipped_faces.tolist() == [1]
        assert result.faces[0] == given_faces[0]


def test_components_are_turned_one_by_one() -> None:
    part = grid_faces(3, 3).tolist()
    faces = part + [[v + 9 for v in face] for face in part] + [[v + 18 for v in face] for face in part]
    which = {1, 4, 6, 7, 10, 8, 11, 9}  # of 0..3: one, of 4..7: three, of 8..11: all
    result = repair_mesh(torch.zeros(27, 3), turn_over(faces, which))
    assert result.flipped_faces.tolist() == [1, 5]


def test_no_smaller_set_of_faces_would_do() -> None:
    """Against trying every set of faces, on a cube with random faces turned over."""
    vertices, topology = cube()
    for which in ({0, 3}, {0, 1, 2}, {1, 2, 4, 5}):
        faces = turn_over(topology.face_lists(), which)
        flipped = repair_mesh(vertices, faces).flipped_faces.numel()
        for size in range(flipped):
            for subset in itertools.combinations(range(6), size):
                with pytest.raises(MeshError):
                    Topology.from_faces(turn_over(faces, set(subset)))


def test_unused_vertices_are_dropped_in_order() -> None:
    vertices = torch.arange(24.0).reshape(8, 3)
    result = repair_mesh(vertices, [[6, 1, 3], [1, 6, 4]])
    assert result.kept_vertices.tolist() == [1, 3, 4, 6]
    assert torch.equal(result.vertices, vertices[[1, 3, 4, 6]])
    assert result.faces == [[3, 0, 1], [0, 3, 2]]
    assert result.topology.num_vertices == 4
    assert result.messages == ["dropped 4 unused vertex(es) and renumbered the others: vertices 0, 2, 5, 7."]


def test_both_repairs_are_told() -> None:
    faces = turn_over(split_quads(grid_faces(3, 3)).tolist(), {2})
    result = repair_mesh(torch.zeros(10, 3), faces)
    assert result.messages == [
        "turned over 1 of 8 faces so that neighbours agree: faces 2.",
        "dropped 1 unused vertex(es) and renumbered the others: vertices 9.",
    ]


def test_polygons_keep_their_first_corner() -> None:
    faces = [[0, 1, 2, 3, 4], [1, 0, 5, 6], [2, 1, 7]]
    result = repair_mesh(torch.zeros(8, 3), turn_over(faces, {0}))
    assert result.flipped_faces.tolist() == [0]
    assert result.faces == faces


def test_batches_and_gradients_pass_through() -> None:
    vertices = torch.rand(2, 5, 3, requires_grad=True)
    result = repair_mesh(vertices, [[0, 1, 4]])
    result.vertices.sum().backward()
    assert result.vertices.shape == (2, 3, 3)
    assert vertices.grad is not None
    assert vertices.grad[:, [2, 3]].abs().max() == 0
    assert (vertices.grad[:, [0, 1, 4]] == 1).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(3, 12), st.integers(0, 2**32 - 1))
def test_one_sided_surfaces_are_refused(size: int, seed: int) -> None:
    which = set(np.flatnonzero(np.random.default_rng(seed).random(size) < 0.5).tolist())
    with pytest.raises(MeshError, match=r"one-sided.*faces 0, 1, 2"):
        repair_mesh(torch.zeros(2 * size, 3), turn_over(moebius_faces(size), which))


def test_only_the_one_sided_part_is_blamed() -> None:
    faces = [[100, 101, 102], *moebius_faces(6)]
    with pytest.raises(MeshError, match=r"one-sided.* 6 connected face\(s\).*faces 1, 2, 3, 4, 5 and 1 more"):
        repair_mesh(torch.zeros(103, 3), faces)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 2], [0, 1, 3], [1, 0, 4]], "non-manifold: .* more than two faces"),
        ([[0, 1]], "fewer than three corners"),
        ([[0, 1, 6]], "out of range"),
    ],
)
def test_other_faults_stay_faults(faces: list[list[int]], message: str) -> None:
    with pytest.raises(MeshError, match=message):
        repair_mesh(torch.zeros(6, 3), faces)


def test_a_pillow_is_not_a_face_that_occurs_twice() -> None:
    assert repair_mesh(torch.zeros(3, 3), [[0, 1, 2], [0, 2, 1]]).flipped_faces.numel() == 0


@pytest.mark.parametrize("shape", [(3,), (4, 2)])
def test_vertices_must_be_points(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match=r"\(\*batch, V, 3\)"):
        repair_mesh(torch.zeros(shape), [[0, 1, 2]])
