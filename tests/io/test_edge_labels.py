"""Marked edges survive files, and faults are named with their line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from principal_lattices import LATTICES

from torchfair import MeshError, MeshFileError, ShapeError, Topology, load_mesh, save_mesh
from torchfair.io import edge_labels_path, load_edge_labels, save_edge_labels
from torchfair.principal import principal_edges_of_lattice

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
SQUARE_TOPOLOGY = Topology.from_faces([[0, 1, 2], [0, 2, 3]])


def marked(labels: torch.Tensor, topology: Topology = SQUARE_TOPOLOGY) -> list[tuple[int, ...]]:
    return sorted(tuple(sorted(pair)) for pair in topology.edges[labels].tolist())


def read(tmp_path: Path, text: str, name: str = "m.obj") -> list[tuple[int, ...]]:
    path = tmp_path / name
    path.write_text(text)
    return marked(load_edge_labels(path, SQUARE_TOPOLOGY))


@pytest.mark.parametrize("name", LATTICES)
def test_labels_survive_an_obj_file(tmp_path: Path, name: str) -> None:
    mesh, along = LATTICES[name]
    edges = principal_edges_of_lattice(mesh, along)
    path = tmp_path / "mesh.obj"
    save_mesh(path, mesh.vertices, mesh.topology, polylines=edges.polylines())
    back = load_mesh(path)
    assert torch.equal(back.vertices, mesh.vertices)
    assert back.topology.face_lists() == mesh.topology.face_lists()
    assert torch.equal(load_edge_labels(edge_labels_path(path), back.topology), edges.mask)
    without = path.with_name("without.obj")
    save_mesh(without, mesh.vertices, mesh.topology)
    lines = [line for line in path.read_text().splitlines(keepends=True) if not line.startswith("l ")]
    assert "".join(lines) == without.read_text()


@pytest.mark.parametrize("suffix", [".ply", ".off"])
def test_labels_survive_beside_other_formats(tmp_path: Path, suffix: str) -> None:
    mesh, along = LATTICES["Enneper v straight"]
    path = tmp_path / f"mesh{suffix}"
    save_mesh(path, mesh.vertices, mesh.topology)
    beside = edge_labels_path(path)
    assert beside == tmp_path / "mesh.edges.json"
    save_edge_labels(beside, mesh.topology, mesh.edges_along(along))
    assert torch.equal(load_edge_labels(beside, load_mesh(path).topology), mesh.edges_along(along))
    with pytest.raises(MeshFileError, match=r"belong into mesh\.edges\.json"):
        load_edge_labels(path, mesh.topology)
    with pytest.raises(MeshFileError, match="exists already"):
        save_edge_labels(beside, mesh.topology, mesh.edges_along("u"))
    save_edge_labels(beside, mesh.topology, mesh.edges_along("u"), overwrite=True)
    assert torch.equal(load_edge_labels(beside, mesh.topology), mesh.edges_along("u"))


@settings(max_examples=25, deadline=None)
@given(chosen=st.lists(st.booleans(), min_size=5, max_size=5))
def test_any_labels_survive_a_json_file(tmp_path_factory: pytest.TempPathFactory, chosen: list[bool]) -> None:
    path = tmp_path_factory.mktemp("labels") / "a.json"
    labels = torch.tensor(chosen)
    save_edge_labels(path, SQUARE_TOPOLOGY, labels)
    assert torch.equal(load_edge_labels(path, SQUARE_TOPOLOGY), labels)


@pytest.mark.parametrize(
    "lines",
    ["l 1 3 4\n", "l 4 3\nl 3 1\n", "l 1/7 3/8 4/9\n", "l -4 -2 -1\n", "g rails\nl 1 3 \\\n4\n# l 1 2\nl 1 3\n"],
)
def test_ways_to_write_line_elements(tmp_path: Path, lines: str) -> None:
    assert read(tmp_path, SQUARE + lines) == [(0, 2), (2, 3)]
    assert read(tmp_path, "\ufeff" + (SQUARE + lines).replace("\n", "\r\n"), "M.OBJ") == [(0, 2), (2, 3)]
    assert load_mesh(tmp_path / "m.obj").topology.face_lists() == [[0, 1, 2], [0, 2, 3]]


def test_line_elements_between_vertices_count_back_from_where_they_stand(tmp_path: Path) -> None:
    head, tail = SQUARE.split("v 0 1 0\n")
    assert read(tmp_path, head + "l -3 -1\nv 0 1 0\n" + tail) == [(0, 2)]


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        ("l 1 3\nl 2 4\n", r"line 8: vertices 2 and 4 are not joined by an edge of the mesh"),
        ("l 1 1\n", "line 7: vertices 1 and 1 are not joined"),
        ("l 1 3 9\n", r"line 7: marks the edge \(3, 9\), but the vertices are numbered 1..4"),
        ("l -5 1\n", "line 7: marks the edge"),
        ("l 0 1\n", "line 7: marks the edge"),
        ("l 1\n", "line 7: a line element needs two or more vertices"),
        ("\nl 1 3\nl\n", "line 9: a line element needs two"),
        ("l 1 x\n", "line 7: expected a whole number"),
        ("l 1 3/b\n", "line 7: a point of a line element must look like"),
        ("l 1 1e3\n", "line 7: expected a whole number"),
        ("v 0 0 1\nl 1 3\n", "its vertices are 5, those of the mesh 4"),
        ("w 3 4\n", "line 7: 'w' does not start an OBJ statement"),
        ("", "marks no edges: there are no line elements"),
    ],
)
def test_faults_of_obj_files(tmp_path: Path, lines: str, fault: str) -> None:
    with pytest.raises(MeshFileError, match=fault):
        read(tmp_path, SQUARE + lines)


HEAD = '{"format": "torchfair edges", "version": 1, "num_vertices": 4, "edges": '


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (HEAD + "[[1, 3]]}", "vertices 1 and 3 are not joined"),
        (HEAD + "[[0, 4]]}", r"marks the edge \(0, 4\), but the vertices are numbered 0..3"),
        (HEAD + "[[0, -1]]}", "marks the edge"),
        (HEAD + "[[0, 1.0]]}", "pairs of vertex numbers"),
        (HEAD + "[[0, true]]}", "pairs of vertex numbers"),
        (HEAD + "[[0, 1, 2]]}", "pairs of vertex numbers"),
        (HEAD + "[[0, 1" + "0" * 30 + "]]}", "pairs of vertex numbers"),
        (HEAD + "7}", "pairs of vertex numbers"),
        (HEAD.replace("4", "5") + "[]}", "its vertices are 5"),
        (HEAD.replace("4", "null") + "[]}", "pairs of vertex numbers"),
        (HEAD.replace("1", "2") + "[]}", "is no file of edge labels"),
        ("[]", "is no file of edge labels"),
        (HEAD + "[[", "is no JSON file"),
        ("[" * 100_000, "is no JSON file"),
        ("\xff", "is no"),
        ("", "is empty"),
    ],
)
def test_faults_of_json_files(tmp_path: Path, text: str, fault: str) -> None:
    with pytest.raises(MeshFileError, match=fault):
        read(tmp_path, text, "m.json")


def test_files_that_cannot_be_written(tmp_path: Path) -> None:
    points = torch.zeros(4, 3)
    for line, error, fault in (
        (torch.tensor([1]), MeshError, "expected two or more vertex numbers from 0 to 3, got 1"),
        (torch.tensor([1, 4]), MeshError, "got 1, 4"),
        (torch.tensor([-1, 2]), MeshError, "got -1, 2"),
        (torch.tensor([0.0, 1.0]), ShapeError, "polylines: expected vertex numbers"),
        (torch.tensor([[0, 1]]), ShapeError, "polylines: expected vertex numbers"),
    ):
        with pytest.raises(error, match=re.escape(fault)):
            save_mesh(tmp_path / "m.obj", points, SQUARE_TOPOLOGY, polylines=[line])
    with pytest.raises(MeshFileError, match="only OBJ files hold polylines"):
        save_mesh(tmp_path / "m.ply", points, SQUARE_TOPOLOGY, polylines=[torch.tensor([0, 1])])
    with pytest.raises(MeshFileError, match=r"written to \.json files"):
        save_edge_labels(tmp_path / "m.txt", SQUARE_TOPOLOGY, torch.zeros(5, dtype=torch.bool))
    with pytest.raises(ShapeError, match=r"labels: expected a bool tensor \(5,\)"):
        save_edge_labels(tmp_path / "m.json", SQUARE_TOPOLOGY, torch.zeros(5))
    assert list(tmp_path.iterdir()) == []
