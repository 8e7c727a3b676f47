"""Edges by words of two vertices, a direction and a half-edge: what pairing without words gives, or None."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mesh_shelf import SHELF, each_mesh

from torchfair import MeshError, Topology, _connectivity, _fans, _paired_half_edges
from torchfair._half_edges import HalfEdges, build_half_edges, pack_faces
from torchfair._paired_half_edges import paired_edges

PARTS = ("vertices", "faces", "twins", "corner_edges")


def half_edges(faces: object, count: int | None = None) -> HalfEdges:
    return build_half_edges(*pack_faces(faces), count)


def assert_same(half: HalfEdges, block: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_paired_half_edges, "_BLOCK", block)
        quick = paired_edges(half)
        patch.setattr(_connectivity, "paired_edges", lambda half: None)
        slow = _connectivity.build_edges(half)
    assert quick is not None
    for name in PARTS:
        ours, theirs = getattr(quick, name), getattr(slow, name)
        assert ours.dtype == theirs.dtype == np.int64, name
        np.testing.assert_array_equal(ours, theirs, name)


@each_mesh
@pytest.mark.parametrize("block", [1, 5, 1 << 15])
def test_all_shapes(faces: object, block: int) -> None:
    assert_same(half_edges(faces), block)


@given(st.sampled_from(sorted(SHELF)), st.integers(0, 2**32 - 1), st.integers(1, 9))
def test_some_faces_in_any_order(name: str, seed: int, block: int) -> None:
    """With boundaries anywhere, faces that touch in a vertex, and any numbers of vertices and first corners."""
    random = np.random.default_rng(seed)
    faces = [list(face) for face in SHELF[name]]
    count = 1 + max(max(face) for face in faces)
    renamed = random.permutation(count + 3)
    kept = random.permutation(len(faces))[: random.integers(1, len(faces), endpoint=True)]
    some = [np.roll(renamed[faces[i]], random.integers(4)).tolist() for i in kept]
    assert_same(half_edges(some, count + 3), block)


@pytest.mark.parametrize(
    "faces",
    [
        [[0, 1, 2], [0, 1, 3]],
        [[0, 1, 2], [1, 0, 3], [0, 1, 4]],
        [[0, 1, 2], [1, 0, 3], [1, 0, 4]],
        [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]],
        [[4, 5, 6], [0, 1, 2, 3], [6, 5, 4, 7], [0, 1, 7]],
    ],
)
@pytest.mark.parametrize("block", [1, 2, 3, 1 << 15])
def test_edges_that_are_no_manifold_are_left_to_the_way_that_names_them(
    faces: list[list[int]], block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_paired_half_edges, "_BLOCK", block)
    assert paired_edges(half_edges(faces)) is None
    with pytest.raises(MeshError, match=r"non-manifold|inconsistent orientation"):
        Topology.from_faces(faces)


def test_words_have_64_bits() -> None:
    """Of as many vertices as leave none to spare, and of one more; nothing is lost in the highest of them."""
    most = 2**30  # squares of 60 bits, a direction, and 3 bits for 6 corners
    last = [most - 6, most - 1, most - 3]
    faces = [last, [last[1], last[0], most - 2]]
    assert_same(half_edges(faces, most), 1 << 15)
    assert paired_edges(half_edges(faces, most + 1)) is None
    assert Topology.from_faces(faces, most + 1, manifold="edges") is not None


@given(st.sampled_from(sorted(SHELF)), st.integers(0, 2**32 - 1), st.integers(1, 9))
def test_fans_are_looked_at_some_vertices_at_a_time(name: str, seed: int, block: int) -> None:
    """Faces are refused, or not, in the same words."""
    random = np.random.default_rng(seed)
    faces = SHELF[name]
    some = [faces[i] for i in random.permutation(len(faces))[: random.integers(1, len(faces), endpoint=True)]]
    joined = random.integers(0, 4)  # vertices of a second copy that are those of the first
    count = 1 + max(max(face) for face in some)
    same = random.permutation(count)[:joined]
    names = np.arange(count) + count
    names[same] = same
    said = []
    for size in (block, 1 << 16):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_fans, "_BLOCK", size)
            try:
                said.append(Topology.from_faces([*some, *(names[list(face)].tolist() for face in some)]).ring_vertices)
            except MeshError as error:
                said.append(str(error))
    assert str(said[0]) == str(said[1])
