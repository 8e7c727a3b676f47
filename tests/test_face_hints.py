"""Faces as other programs give them are refused with what to do."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from torchfair import MeshError, Topology

STRIP = np.array([[i, i + 1, i + 2] if i % 2 == 0 else [i + 1, i, i + 2] for i in range(8)])
TRANSPOSED = r"If the columns are the faces, an array \(3, {}\), pass faces\.T\."
PADDED = r"uses vertex -1.* -1 behind the last corner, as in \[a, b, c, -1\], is padding: leave it out\."
TWICE = r"more than once.* \[a, b, c, c\] for a triangle: leave out the last one, as torchfair.repair_mesh does\."


def told(faces: object) -> str:
    with pytest.raises(MeshError) as caught:
        Topology.from_faces(faces)
    return str(caught.value)


@pytest.mark.parametrize("count", [1, 2, 5, 8])
def test_columns(count: int) -> None:
    faces = STRIP[:count].T
    for given in (faces, torch.from_numpy(faces.copy()), faces.tolist()):
        with pytest.raises(MeshError, match=TRANSPOSED.format(count)):
            Topology.from_faces(given)
    assert Topology.from_faces(faces.T).num_faces == count


@pytest.mark.parametrize("faces", [[[0, 1], [1, 2]], [[0, 1, 2], [0, 2, 0], [2, 3, 3]], [[0, 1], [1, 2, 3], [3, 4]]])
def test_others_are_no_columns(faces: list[list[int]]) -> None:
    assert "faces.T" not in told(faces)
    assert "faces.T" not in told(STRIP[:4].T)  # three quads are as likely


def test_padding() -> None:
    with pytest.raises(MeshError, match=PADDED):
        Topology.from_faces([[0, 1, 2, 3], [1, 4, 2, -1]])
    assert "padding" not in told([[0, 1, 2, -2]])
    with pytest.raises(MeshError, match="out of range") as caught:
        Topology.from_faces([[0, 1, 2], [1, 3, -1]], 3)  # 3 is none, either
    assert "padding" not in str(caught.value)


def test_triangles_as_quads_with_a_corner_twice() -> None:
    with pytest.raises(MeshError, match=TWICE):
        Topology.from_faces([[0, 1, 2, 2], [1, 3, 4, 2], [2, 4, 5, 5]])
    for others in ([[0, 1, 1, 2]], [[0, 0, 1, 2]], [[0, 1, 2, 2], [2, 1, 3, 1]], [[0, 0, 2, 2]], [[0, 1, 2, 3, 3]]):
        assert "[a, b, c, c]" not in told(others)
