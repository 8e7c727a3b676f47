"""Faces that are no manifold are refused by name; copies of a topology are complete."""

from __future__ import annotations

import copy
import pickle
import re
from collections import defaultdict
from collections.abc import Callable

import numpy as np
import pytest
import torch
from helpers import grid_faces, split_quads
from mesh_shelf import HYBRID, SHELF, same

from torchfair import MeshError, ShapeError, Topology

# ---- errors ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("faces", "num_vertices", "message"),
    [
        ([[0, 1, 2], [1, 2]], None, r"1 face\(s\) have fewer than three corners: faces 1\. Remove"),
        (np.zeros((2, 0), int), None, r"2 face\(s\) have fewer than three corners: faces 0, 1"),
        (
            [[0, 1, 2], [2, 1, 1]],
            None,
            r"1 face\(s\) use a vertex more than once: faces 1\. Remove the repeated corner",
        ),
        ([[0, 1, -1]], None, r"out of range .* face 0 uses vertex -1"),
        ([[0, 1, 2], [2, 1, 3]], 3, r"out of range 0 <= number < 3: face 1 uses vertex 3\. .*pass num_vertices"),
        ([[0, 1, 2**62]], None, "out of range"),
        ([[0, 1, 2]], -1, "num_vertices must lie between"),
        ([[0, 1, 2], [0, 1, 3], [1, 0, 4]], None, r"non-manifold: .* edge \(0, 1\) of faces \[0, 1, 2\]\. Remove"),
        (
            [[0, 1, 2], [0, 1, 3]],
            None,
            r"inconsistent orientation: 1 edge.* faces 0 and 1 along edge \(0, 1\).*repair_",
        ),
        ([[0, 1, 2], [0, 3, 4]], None, r"non-manifold: .*more than one fan: vertices 0\. Duplicate such a vertex"),
        (SHELF["tetrahedron"] + [[0, 4, 5]], None, "more than one fan: vertices 0"),
        (SHELF["pillow"] + [[0, 3, 4], [0, 4, 3]], None, "more than one fan: vertices 0"),
        ([[0, 1, 2.5]], None, "must be integers, got dtype float64"),
        (np.zeros((2, 3)), None, r"shape \(2, 3\) and dtype float64"),
        (np.zeros(3, int), None, r"shape \(3,\)"),
        ([[0, 1, [2]]], None, "sequence of vertex numbers"),
        ([0, 1, 2], None, "sequence of vertex numbers"),
        ([["a", "b", "c"]], None, "must be integers"),
        (7, None, "expected an array or a sequence of index sequences, got int"),
    ],
)
def test_faults_are_named(faces: object, num_vertices: int | None, message: str) -> None:
    with pytest.raises(MeshError, match=message):
        Topology.from_faces(faces, num_vertices)


def test_only_the_first_faults_are_listed() -> None:
    with pytest.raises(MeshError, match=r"faces 0, 1, 2, 3, 4 and 15 more\."):
        Topology.from_faces([[0, 0, 1]] * 20)


def test_triangle_tables_refuse_polygons() -> None:
    topology = Topology.from_faces(HYBRID)
    assert not topology.is_triangular
    for ask in ("triangles", "edge_flaps"):
        with pytest.raises(MeshError, match=r"2 face\(s\) are not triangles: faces 2, 3\. Triangulate"):
            getattr(topology, ask)


def test_check_vertices() -> None:
    topology = Topology.from_faces(HYBRID)
    topology.check_vertices(torch.zeros(2, 5, 8, 3))
    for wrong in (torch.zeros(7, 3), torch.zeros(8, 2), torch.zeros(8, 3, dtype=torch.int64), np.zeros((8, 3)), None):
        with pytest.raises(ShapeError, match=r"\(\*batch, 8, 3\)"):
            topology.check_vertices(wrong)  # type: ignore[arg-type]


# ---- moving ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "carry",
    [copy.copy, copy.deepcopy, lambda t: pickle.loads(pickle.dumps(t)), lambda t: t.map_tensors(torch.clone)],
    ids=["copy", "deepcopy", "pickle", "map_tensors"],
)
def test_copies_are_complete(carry: Callable[[Topology], Topology]) -> None:
    topology = Topology.from_faces(split_quads(grid_faces(4, 5)))
    warm = topology.edge_flaps  # cached before the copy
    other = carry(topology)
    assert other is not topology
    assert same(topology, other)
    assert torch.equal(other.edge_flaps, warm)


def test_to_where_it_is_copies_nothing() -> None:
    """As with tensors; a topology cannot change."""
    topology = Topology.from_faces(HYBRID)
    assert topology.to("cpu") is topology
    assert topology.cpu() is topology


def test_to_moves_every_tensor() -> None:
    moved = Topology.from_faces(HYBRID).to("meta")
    assert moved.device == torch.device("meta")
    tensors = defaultdict(list)
    for name, value in vars(moved).items():
        if isinstance(value, torch.Tensor):
            tensors[value.device.type].append(name)
    assert set(tensors) == {"meta"}
    assert sorted(tensors["meta"]) == sorted(
        ("corners", "face_offsets", "corner_faces", "corner_edges", "edges", "interior_edge_faces")
    )


def test_topology_is_frozen() -> None:
    topology = Topology.from_faces(HYBRID)
    with pytest.raises(AttributeError):
        topology.num_vertices = 9  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "words"),
    [("tetrahedron", "triangle mesh: 4 vertices, 6 edges"), ("cube", "quad mesh"), ("hybrid", r"polygon.*\(7 on")],
)
def test_repr(name: str, words: str) -> None:
    assert re.search(words, repr(Topology.from_faces(SHELF[name])))
