"""Connectivity: counted by hand on small meshes, against slow loops, and against trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from helpers import grid_faces, wavy_grid
from mesh_shelf import HYBRID, SHELF, each_mesh, same

from torchfair import Topology

# ---- counts ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "vertices", "edges", "interior", "faces", "loops"),
    [
        ("tetrahedron", 4, 6, 6, 4, 0),
        ("cube", 8, 12, 12, 6, 0),
        ("triangle", 3, 3, 0, 1, 1),
        ("pillow", 3, 3, 3, 2, 0),
        ("quad grid", 20, 31, 17, 12, 1),
        ("triangle grid", 20, 43, 29, 24, 1),
        ("hybrid", 8, 11, 4, 4, 1),
        ("torus", 20, 40, 40, 20, 0),
        ("annulus", 16, 24, 8, 8, 2),
    ],
)
def test_counts(name: str, vertices: int, edges: int, interior: int, faces: int, loops: int) -> None:
    topology = Topology.from_faces(SHELF[name])
    counted = (topology.num_vertices, topology.num_edges, topology.num_interior_edges, topology.num_faces)
    assert counted == (vertices, edges, interior, faces)
    assert len(topology.boundary_loops()) == loops


@pytest.mark.parametrize(
    ("name", "characteristic"),
    [("tetrahedron", 2), ("cube", 2), ("pillow", 2), ("triangle", 1), ("hybrid", 1), ("torus", 0), ("annulus", 0)],
)
def test_euler_characteristic(name: str, characteristic: int) -> None:
    topology = Topology.from_faces(SHELF[name])
    assert topology.num_vertices - topology.num_edges + topology.num_faces == characteristic


@each_mesh
def test_corners_are_counted_twice_by_edges_and_once_by_vertices(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces)
    assert topology.num_edges + topology.num_interior_edges == topology.corners.numel()
    assert int(topology.valences.sum()) == 2 * topology.num_edges


def test_a_mesh_without_faces() -> None:
    for faces in ([], np.zeros((0, 3), int), torch.zeros(0, 4, dtype=torch.int64)):
        topology = Topology.from_faces(faces, num_vertices=3)
        assert (topology.num_vertices, topology.num_edges, topology.num_faces) == (3, 0, 0)
        assert topology.valences.tolist() == [0, 0, 0]
        assert topology.boundary_loops() == []
        assert topology.edge_flaps.shape == (0, 4)
        assert topology.rings_by_valence == {}
    assert Topology.from_faces([]).num_vertices == 0


def test_isolated_vertices_have_empty_rings_and_no_boundary() -> None:
    topology = Topology.from_faces(SHELF["two parts, a gap in the numbers"], num_vertices=12)
    isolated = [3, 4, 10, 11]
    assert (topology.valences == 0).nonzero().squeeze(1).tolist() == isolated
    assert not topology.is_boundary_vertex[isolated].any()
    assert topology.is_boundary_vertex.sum() == 8


# ---- forms of input --------------------------------------------------------------------------------------


def test_all_forms_of_input_agree() -> None:
    array = grid_faces(3, 4)
    lists = [array.tolist(), tuple(map(tuple, array)), list(array)]
    forms = [array, array.astype(np.uint8), torch.from_numpy(array), *lists]
    first = Topology.from_faces(forms[0])
    assert all(same(first, Topology.from_faces(form)) for form in forms[1:])


def test_the_input_may_change_afterwards() -> None:
    array = grid_faces(3, 4)
    before, offsets = array.ravel().copy(), np.arange(7) * 4
    plain, packed = Topology.from_faces(array), Topology.from_packed_faces(before, offsets)
    array[:], before[:], offsets[:] = 0, 0, 0
    assert same(plain, packed)
    assert plain.corners.tolist() == grid_faces(3, 4).ravel().tolist()


def test_packed_faces_give_back_the_lists() -> None:
    topology = Topology.from_faces(HYBRID)
    assert topology.face_lists() == HYBRID
    assert topology.face_sizes.tolist() == [3, 3, 4, 5]
    assert {k: (n.tolist(), c.tolist()) for k, (n, c) in topology.faces_by_size.items()} == {
        3: ([0, 1], HYBRID[:2]),
        4: ([2], [HYBRID[2]]),
        5: ([3], [HYBRID[3]]),
    }


# ---- slow references -------------------------------------------------------------------------------------


def half_edges(faces: list[list[int]]) -> dict[tuple[int, int], int]:
    return {(v, w): f for f, face in enumerate(faces) for v, w in zip(face, face[1:] + face[:1], strict=True)}


def slow_edges(faces: list[list[int]]) -> tuple[list[tuple[int, int]], list[tuple[int, int]], list[tuple[int, int]]]:
    """Interior edges, their left and right faces, and boundary edges."""
    owner = half_edges(faces)
    interior = sorted((v, w) for v, w in owner if v < w and (w, v) in owner)
    boundary = sorted(((v, w) for v, w in owner if (w, v) not in owner), key=sorted)
    return interior, [(owner[v, w], owner[w, v]) for v, w in interior], boundary


def slow_ring(faces: list[list[int]], vertex: int) -> list[int]:
    """Neighbours counterclockwise: from each neighbour to the corner before ``vertex`` in the face on the left."""
    step = {}
    for face in faces:
        if vertex in face:
            i = face.index(vertex)
            step[face[(i + 1) % len(face)]] = face[i - 1]
    if not step:
        return []
    ring = [next(iter(set(step) - set(step.values())), next(iter(step)))]
    while ring[-1] in step and step[ring[-1]] != ring[0]:
        ring.append(step[ring[-1]])
    return ring


@each_mesh
def test_edges_against_a_slow_loop(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces)
    interior, sides, boundary = slow_edges(faces)
    assert list(map(tuple, topology.interior_edges.tolist())) == interior
    assert list(map(tuple, topology.interior_edge_faces.tolist())) == sides
    assert list(map(tuple, topology.boundary_edges.tolist())) == boundary


@each_mesh
def test_rings_against_a_slow_loop(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces, num_vertices=11 + max(map(max, faces)))
    for vertex, ring in enumerate(torch.split(topology.ring_vertices, topology.valences.tolist())):
        assert ring.tolist() == slow_ring(faces, vertex)


@each_mesh
def test_corner_tables(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces)
    heads = topology.corners[topology.next_corners]
    along = torch.stack([topology.corners, heads], dim=1)
    edges = topology.edges[topology.corner_edges]
    assert torch.equal(along.sort(1).values, edges.sort(1).values)
    assert topology.corner_faces.tolist() == [f for f, face in enumerate(faces) for _ in face]
    assert heads.tolist() == [w for face in faces for w in face[1:] + face[:1]]


@each_mesh
def test_loops_are_the_boundary_edges_in_sequence(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces)
    loops = [loop.tolist() for loop in topology.boundary_loops()]
    steps = [step for loop in loops for step in zip(loop, loop[1:] + loop[:1], strict=True)]
    assert sorted(steps) == sorted(map(tuple, topology.boundary_edges.tolist()))
    assert all(loop[0] == min(loop) for loop in loops)
    assert [loop[0] for loop in loops] == sorted(loop[0] for loop in loops)


@each_mesh
def test_rings_of_boundary_vertices_run_along_the_boundary(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces)
    for loop in topology.boundary_loops():
        first = topology.ring_vertices[topology.ring_offsets[loop]]
        last = topology.ring_vertices[topology.ring_offsets[loop + 1] - 1]
        assert torch.equal(first, loop.roll(-1))
        assert torch.equal(last, loop.roll(1))


def test_interior_edges_agree_with_trimesh() -> None:
    import trimesh

    vertices, topology = wavy_grid(7, 6, triangles=True)
    mesh = trimesh.Trimesh(vertices.numpy(), topology.triangles.numpy(), process=False)
    adjacency = zip(mesh.face_adjacency_edges, mesh.face_adjacency, strict=True)
    theirs = {tuple(sorted(edge)): set(pair) for edge, pair in adjacency}
    pairs = zip(topology.interior_edges.tolist(), topology.interior_edge_faces.tolist(), strict=True)
    assert {tuple(sorted(edge)): set(sides) for edge, sides in pairs} == theirs
