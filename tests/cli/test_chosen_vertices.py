from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from helpers import wavy_grid

from torchfair._names import Names
from torchfair.cli.chosen_vertices import ChosenVertices, faces_of_file, joined_places
from torchfair.cli.errors import CommandError
from torchfair.io import PolygonMesh


def grid(first: int = 1) -> PolygonMesh:
    """Five by five vertices."""
    vertices, topology = wavy_grid(5, 5)
    return PolygonMesh(vertices, topology, names=Names(first))


def words_of(place: torch.Tensor) -> str:
    return " ".join(repr(x) for x in place.tolist())


@pytest.mark.parametrize("first", [0, 1])
def test_number_and_place_find_the_same_vertex(first: int) -> None:
    chosen = ChosenVertices(grid(first))
    places = chosen.mesh.vertices + 0.01
    for vertex in (0, 7, 24):
        near = f"near {words_of(places[vertex])}"
        assert chosen.of("--fix", near) == chosen.of("--fix", str(vertex + first)) == [vertex]
        assert chosen.handle("--handle", f"{near} to 1 2 3") == (vertex, [1.0, 2.0, 3.0])
        assert chosen.handle("--handle", f"{vertex + first} 1 2 3") == (vertex, [1.0, 2.0, 3.0])
        assert f"vertex {vertex + first} at " in chosen.notes[-1]
    assert chosen.of("--fix", f"{first} near {words_of(places[3])} {first + 1}") == [0, 3, 1]
    assert len(chosen.of("--fix", "box 9 9 9 -9 -9 -9")) == 25


@pytest.mark.parametrize("first", [0, 1])
def test_numbers_before_the_first_and_behind_the_last_are_refused(first: int) -> None:
    chosen = ChosenVertices(grid(first))
    for number in (first - 1, first + 25):
        with pytest.raises(CommandError, match=f"numbered {first} to {first + 24} in the file, got {number}"):
            chosen.numbered("--fix", str(number))


@pytest.mark.parametrize("words", ["1 0 0 nan", "1 inf 0 0", "near 0 nan 0 to 0 0 1", "near 0 0 0 to 0 0 -inf"])
def test_handles_that_are_not_finite_are_refused_as_they_were_written(words: str) -> None:
    with pytest.raises(CommandError, match=f"^--handle: coordinates must be finite numbers, got '{words}'$"):
        ChosenVertices(grid()).handle("--handle", words)


def test_a_place_is_refused_where_it_is_far_or_could_be_two_vertices() -> None:
    chosen = ChosenVertices(grid())
    vertices = chosen.mesh.vertices
    with pytest.raises(CommandError, match=r"vertex [12] at .* vertex [12] at"):
        chosen.near("--fix", vertices[:2].mean(0).tolist())
    with pytest.raises(CommandError, match=r"no vertex is there; the nearest one, vertex 25 at .* unit"):
        chosen.near("--fix", (vertices[24] + 5.0).tolist())
    assert chosen.notes == []


def test_vertices_at_the_same_place_are_told_apart_by_number_only() -> None:
    vertices, topology = wavy_grid(5, 5)
    vertices[24] = vertices[23]
    with pytest.raises(CommandError, match=r"not clear.*--weld"):
        ChosenVertices(PolygonMesh(vertices, topology)).near("--fix", vertices[24].tolist())


def test_vertices_of_no_face_are_not_found_by_place() -> None:
    vertices, topology = wavy_grid(5, 5)
    spare = torch.cat([vertices, vertices[:1] + 0.001])
    mesh = PolygonMesh(spare, type(topology).from_faces(topology.face_lists(), 26))
    assert ChosenVertices(mesh).near("--fix", spare[25].tolist()) == 0


def test_after_welding_numbers_are_those_of_the_file() -> None:
    """Six vertices in the file, the last two of which became the first two; the third was dropped."""
    mesh = replace(grid(), vertex_map=torch.tensor([0, 1, -1, 2, 0, 1]))
    chosen = ChosenVertices(mesh)
    assert [chosen.numbered("--fix", word) for word in "12456"] == [0, 1, 2, 0, 1]
    with pytest.raises(CommandError, match="vertex 3 is one that no face uses"):
        chosen.numbered("--fix", "3")
    assert chosen.names_of(0) == "vertices 1, 5 of the file are one, which is"


def test_an_edge_is_found_near_its_middle_and_not_at_its_end() -> None:
    chosen = ChosenVertices(grid())
    for edge in (0, 11, 30):
        middle = chosen.mesh.vertices[chosen.mesh.topology.edges[edge]].mean(0)
        assert chosen.edge_near("--seed", middle.tolist()) == edge
    with pytest.raises(CommandError, match="aim at its middle"):
        chosen.edge_near("--seed", chosen.mesh.vertices[12].tolist())


def test_faces_are_counted_as_in_the_file() -> None:
    mesh = replace(grid(), names=Names(1, faces=np.arange(16) + 2))  # the first two faces were dropped
    assert faces_of_file("--planar", (3, 18), mesh) == (0, 15)
    with pytest.raises(CommandError, match="3 to 18"):
        faces_of_file("--planar", (2,), mesh)


@pytest.mark.parametrize(
    ("words", "joined"),
    [
        ("--handle 3 1 -2 3e-1 in.obj", ["--handle=3 1 -2 3e-1", "in.obj"]),
        ("--handle near 1 2 3 to 4 5 6 --force", ["--handle=near 1 2 3 to 4 5 6", "--force"]),
        ("in.obj --fix 1 2 --fix box 0 0 0 1 1 1", ["in.obj", "--fix=1 2", "--fix=box 0 0 0 1 1 1"]),
        ("--handle a b c d in.obj", ["--handle=a b c d", "in.obj"]),
        ("--fix --force", ["--fix", "--force"]),
        ("--fix=3 4", ["--fix=3", "4"]),
    ],
)
def test_words_of_places_are_joined_once(words: str, joined: list[str]) -> None:
    assert joined_places(words.split()) == joined
    assert joined_places(joined) == joined
