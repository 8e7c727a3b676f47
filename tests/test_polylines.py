"""Mesh polylines: straight through regular vertices, each edge once."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from helpers import cube, grid_faces, split_quads, tetrahedron, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_shelf import HYBRID, torus_faces

from torchfair import MeshError, ShapeError, Topology
from torchfair.polylines import mesh_polylines, polylines_along, straight_triples


def torus(rows: int, columns: int, *, triangles: bool = False) -> Topology:
    faces = torus_faces(rows, columns)
    return Topology.from_faces(split_quads(faces) if triangles else faces)


def shelf() -> dict[str, Topology]:
    holed = [face for face in grid_faces(5, 5).tolist() if face != [6, 11, 12, 7]]
    return {
        "quad grid": Topology.from_faces(grid_faces(4, 5)),
        "triangle grid": Topology.from_faces(split_quads(grid_faces(5, 4))),
        "hybrid": Topology.from_faces(HYBRID, num_vertices=9),
        "holed grid": Topology.from_faces(holed),
        "quad torus": torus(4, 5),
        "triangle torus": torus(5, 4, triangles=True),
        "tetrahedron": tetrahedron()[1],
        "cube": cube()[1],
        "one triangle": Topology.from_faces([[0, 1, 2]]),
        "nothing": Topology.from_faces([], num_vertices=2),
    }


every_mesh = pytest.mark.parametrize("name", shelf())


def edges_along(line: torch.Tensor) -> list[tuple[int, ...]]:
    return [tuple(sorted(step)) for step in zip(line.tolist(), line.tolist()[1:], strict=False)]


def as_sets(triples: torch.Tensor) -> set[tuple[int, int, int]]:
    """Triples without direction."""
    return {(min(a, b), v, max(a, b)) for a, v, b in triples.tolist()}


def slow_triples(topology: Topology) -> set[tuple[int, int, int]]:
    found = set()
    for v, ring in enumerate(torch.split(topology.ring_vertices, topology.valences.tolist())):
        valence = ring.numel()
        if topology.is_boundary_vertex[v]:
            pairs = [(0, valence - 1)] if valence > 2 else []
        else:
            pairs = [(i, i + valence // 2) for i in range(valence // 2)] if valence % 2 == 0 else []
        found |= {(min(int(ring[i]), int(ring[j])), v, max(int(ring[i]), int(ring[j]))) for i, j in pairs}
    return found


@every_mesh
def test_triples_against_a_slow_loop(name: str) -> None:
    topology = shelf()[name]
    triples = straight_triples(topology)
    assert triples.shape == (len(slow_triples(topology)), 3)
    assert triples.dtype == torch.int64
    assert as_sets(triples) == slow_triples(topology)
    assert (triples[:, 1].diff() >= 0).all()


@pytest.mark.parametrize("triangles", [False, True])
def test_triples_of_a_regular_grid_are_collinear(triangles: bool) -> None:
    rows, columns = 6, 7
    faces = grid_faces(rows, columns)
    topology = Topology.from_faces(split_quads(faces) if triangles else faces)
    x, y = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
    points = torch.stack([x.ravel(), y.ravel()], dim=1).double()
    keep = ~topology.is_boundary_vertex
    corners = torch.tensor([0, columns - 1, (rows - 1) * columns, rows * columns - 1])
    triples = straight_triples(topology, corners=corners)
    a, v, b = points[triples].unbind(1)
    assert (a - 2 * v + b).abs().max() == 0
    inner = int(keep.sum())
    assert len(triples) == inner * (3 if triangles else 2) + 2 * (rows + columns - 4)


def test_boundary_triples_keep_the_surface_on_their_left() -> None:
    topology = Topology.from_faces(grid_faces(3, 3))
    boundary = [t for t in straight_triples(topology).tolist() if t[1] != 4]
    assert boundary == [[2, 1, 0], [0, 3, 6], [8, 5, 2], [6, 7, 8]]


def test_corners_are_not_straightened() -> None:
    topology = Topology.from_faces(grid_faces(3, 4))
    plain = straight_triples(topology)
    assert not set(plain[:, 1].tolist()) & {0, 3, 8, 11}  # valence 2
    for corners in (torch.tensor([1, 4]), torch.isin(torch.arange(12), torch.tensor([1, 4]))):
        fewer = straight_triples(topology, corners=corners)
        assert as_sets(plain) - as_sets(fewer) == {(0, 1, 2), (0, 4, 8)}
    interior = straight_triples(topology, corners=torch.tensor([5, 6]))
    assert torch.equal(interior, plain)


@pytest.mark.parametrize(
    ("corners", "error"),
    [
        (torch.tensor([12]), MeshError),
        (torch.tensor([-1]), MeshError),
        (torch.tensor([0.5]), ShapeError),
        (torch.tensor([[1, 2]]), ShapeError),
        (torch.ones(5, dtype=torch.bool), ShapeError),
    ],
)
def test_wrong_corners(corners: torch.Tensor, error: type[Exception]) -> None:
    with pytest.raises(error, match="corners"):
        straight_triples(Topology.from_faces(grid_faces(3, 4)), corners=corners)


@every_mesh
def test_each_edge_is_in_exactly_one_polyline(name: str) -> None:
    topology = shelf()[name]
    lines = mesh_polylines(topology)
    covered = [edge for line in lines for edge in edges_along(line)]
    assert sorted(covered) == sorted(map(tuple, topology.edges.sort(1).values.tolist()))
    assert all(line.dtype == torch.int64 for line in lines)


@every_mesh
def test_polylines_consist_of_the_triples(name: str) -> None:
    topology = shelf()[name]
    lines = mesh_polylines(topology)
    passed = []
    for line in lines:
        closed = bool(line[0] == line[-1]) and slow_closed(line, topology)
        around = torch.cat([line, line[1:2]]) if closed else line
        passed += [(min(a, b), v, max(a, b)) for a, v, b in around.unfold(0, 3, 1).tolist()] if len(around) > 2 else []
    assert sorted(passed) == sorted(slow_triples(topology))


def slow_closed(line: torch.Tensor, topology: Topology) -> bool:
    """Whether a polyline that returns to its first vertex also runs straight through it."""
    a, v, b = int(line[-2]), int(line[0]), int(line[1])
    return (min(a, b), v, max(a, b)) in slow_triples(topology)


def test_polylines_of_a_quad_grid() -> None:
    lines = {tuple(line.tolist()) for line in mesh_polylines(Topology.from_faces(grid_faces(3, 4)))}
    rows = {(3, 2, 1, 0), (4, 5, 6, 7), (8, 9, 10, 11)}
    columns = {(0, 4, 8), (1, 5, 9), (2, 6, 10), (11, 7, 3)}
    assert lines == rows | columns


def test_polylines_of_a_torus_are_its_circles() -> None:
    rows, columns = 4, 5
    lines = [line.tolist() for line in mesh_polylines(torus(rows, columns))]
    assert all(line[0] == line[-1] for line in lines)
    assert sorted(len(line) - 1 for line in lines) == [rows] * columns + [columns] * rows
    assert all(len(set(line)) == len(line) - 1 for line in lines)


def test_an_odd_vertex_ends_every_polyline() -> None:
    """Three edges meet at every vertex of a cube and of a tetrahedron: each edge is a polyline."""
    for _, topology in (cube(), tetrahedron()):
        assert straight_triples(topology).shape == (0, 3)
        assert sorted(edges_along(line)[0] for line in mesh_polylines(topology)) == sorted(
            map(tuple, topology.edges.sort(1).values.tolist())
        )


def test_a_hole_without_corners_is_a_closed_polyline() -> None:
    faces = [face for face in grid_faces(5, 5).tolist() if face != [6, 11, 12, 7]]
    lines = [line.tolist() for line in mesh_polylines(Topology.from_faces(faces))]
    loops = [line for line in lines if line[0] == line[-1]]
    assert len(loops) == 1
    assert loops[0] in ([6, 7, 12, 11, 6], [7, 12, 11, 6, 7])
    assert lines[-1] is loops[0]  # closed ones come last


def test_open_boundary_curves_have_the_surface_on_their_left() -> None:
    topology = Topology.from_faces(grid_faces(5, 6))
    directed = set(map(tuple, topology.boundary_edges.tolist()))
    for line in mesh_polylines(topology):
        steps = list(zip(line.tolist(), line.tolist()[1:], strict=False))
        if tuple(sorted(steps[0])) in {tuple(sorted(edge)) for edge in directed}:
            assert set(steps) <= directed


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(sorted(set(shelf()) - {"nothing"})), st.integers(0, 2**32 - 1))
def test_relabelling(name: str, seed: int) -> None:
    topology = shelf()[name]
    new = torch.from_numpy(np.random.default_rng(seed).permutation(topology.num_vertices))
    faces = [new[torch.tensor(face)].tolist() for face in topology.face_lists()]
    other = Topology.from_faces(faces, topology.num_vertices)
    assert as_sets(new[straight_triples(topology)]) == as_sets(straight_triples(other))
    mine = sorted(sorted(edges_along(new[line])) for line in mesh_polylines(topology))
    assert mine == sorted(sorted(edges_along(line)) for line in mesh_polylines(other))


def test_polylines_along_marked_edges_are_pieces_of_mesh_polylines() -> None:
    vertices, topology = wavy_grid(5, 4, triangles=True)
    assert vertices.shape[0] == topology.num_vertices
    everything = torch.ones(topology.num_edges, dtype=torch.bool)
    lines = [line.tolist() for line in polylines_along(topology, everything)]
    assert lines == [line.tolist() for line in mesh_polylines(topology)]
    marked = torch.arange(topology.num_edges) % 3 > 0
    pieces = [line.tolist() for line in polylines_along(topology, marked)]
    steps = sorted(tuple(sorted(pair)) for line in pieces for pair in itertools.pairwise(line))
    assert steps == sorted(tuple(sorted(pair)) for pair in topology.edges[marked].tolist())
    together = {tuple(line[i : i + 3]) for line in lines for i in range(len(line) - 2)}
    together |= {triple[::-1] for triple in together}
    assert all(tuple(line[i : i + 3]) in together for line in pieces for i in range(len(line) - 2))
    assert polylines_along(topology, ~everything) == []
    with pytest.raises(ShapeError, match="mask"):
        polylines_along(topology, everything[1:])
