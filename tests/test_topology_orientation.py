"""Left and right, counterclockwise, relabelling, and rings of any size."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from helpers import cube, grid_faces, split_quads, tetrahedron, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_shelf import SHELF, fan_faces

from torchfair import Topology

# ---- orientation -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [tetrahedron, cube])
def test_rings_are_counterclockwise_seen_from_outside(shape: Callable[[], tuple[torch.Tensor, Topology]]) -> None:
    vertices, topology = shape()
    centre = vertices.mean(0)
    for valence, (middle, ring) in topology.rings_by_valence.items():
        assert valence == 3
        spokes = vertices[ring] - vertices[middle, None]
        turning = torch.linalg.cross(spokes, spokes.roll(-1, 1)).sum(1)
        assert ((turning * (vertices[middle] - centre)).sum(-1) > 0).all()


@pytest.mark.parametrize("name", SHELF)
def test_corners_of_rings_are_those_between_neighbours(name: str) -> None:
    topology = Topology.from_faces(SHELF[name])
    faces, starts = topology.face_lists(), topology.face_offsets.tolist()
    for valence, (vertices, rings) in topology.rings_by_valence.items():
        corners = topology.ring_corners_by_valence[valence]
        assert corners.shape == rings.shape
        for vertex, ring, own in zip(vertices.tolist(), rings.tolist(), corners.tolist(), strict=True):
            for i, corner in enumerate(own):
                number = int(topology.corner_faces[corner])
                face, place = faces[number], corner - starts[number]
                assert face[place] == vertex
                assert face[(place + 1) % len(face)] == ring[i]
                assert face[place - 1] == ring[(i + 1) % valence]


def test_a_flat_grid_turns_counterclockwise() -> None:
    topology = Topology.from_faces(grid_faces(3, 3))  # rows along x, columns along y, faces up
    assert topology.rings_by_valence[4][0].tolist() == [4]
    ring = topology.rings_by_valence[4][1][0].tolist()
    angles = {7: 0, 5: 1, 1: 2, 3: 3}  # quarter turns of the neighbours of the centre
    quarters = [angles[w] for w in ring]
    assert [(b - a) % 4 for a, b in zip(quarters, quarters[1:] + quarters[:1], strict=True)] == [1, 1, 1, 1]
    assert topology.boundary_loops()[0].tolist() == [0, 3, 6, 7, 8, 5, 2, 1]


def test_edge_flaps_by_hand() -> None:
    """Edge from 0 up to 1, vertex 2 on its left, vertex 3 on its right."""
    topology = Topology.from_faces([[0, 1, 2], [1, 0, 3]])
    assert topology.edge_flaps.tolist() == [[0, 1, 2, 3]]
    assert topology.interior_edge_faces.tolist() == [[0, 1]]


def test_edge_flaps_bound_the_two_faces() -> None:
    _, topology = wavy_grid(triangles=True)
    v, w, a, b = topology.edge_flaps.unbind(1)
    left, right = topology.interior_edge_faces.unbind(1)
    for face, triangle in ((left, (v, w, a)), (right, (w, v, b))):
        corners = topology.triangles[face]
        turned = torch.stack([torch.stack(triangle, 1).roll(k, 1) for k in range(3)])
        assert (turned == corners).all(-1).any(0).all()


def test_turning_all_faces_over_swaps_left_and_right() -> None:
    faces = split_quads(grid_faces(4, 4))
    up, down = Topology.from_faces(faces), Topology.from_faces(faces[:, ::-1])
    assert torch.equal(up.interior_edges, down.interior_edges)
    assert torch.equal(up.interior_edge_faces, down.interior_edge_faces.flip(1))
    assert torch.equal(up.boundary_edges, down.boundary_edges.flip(1))


# ---- invariance ------------------------------------------------------------------------------------------


def canonical_ring(ring: list[int]) -> list[int]:
    start = ring.index(min(ring))
    return ring[start:] + ring[:start]


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(sorted(SHELF)), st.integers(0, 2**32 - 1))
def test_relabelling_vertices_and_faces(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    faces = SHELF[name]
    plain = Topology.from_faces(faces)
    new_vertex, new_face = rng.permutation(plain.num_vertices), rng.permutation(len(faces))
    relabelled: list[list[int]] = [[] for _ in faces]
    for old, face in enumerate(faces):
        turn = int(rng.integers(len(face)))
        relabelled[new_face[old]] = new_vertex[face[turn:] + face[:turn]].tolist()
    other = Topology.from_faces(relabelled, plain.num_vertices)

    def sides(topology: Topology, vertex: np.ndarray, face: np.ndarray) -> dict[tuple[int, int], int]:
        """The face on the left of every directed interior edge."""
        found = {}
        for (v, w), (f, g) in zip(topology.interior_edges.tolist(), topology.interior_edge_faces.tolist(), strict=True):
            found[vertex[v], vertex[w]], found[vertex[w], vertex[v]] = face[f], face[g]
        return found

    keep_v, keep_f = np.arange(plain.num_vertices), np.arange(len(faces))
    assert sides(plain, new_vertex, new_face) == sides(other, keep_v, keep_f)
    assert {(new_vertex[v], new_vertex[w]) for v, w in plain.boundary_edges.tolist()} == set(
        map(tuple, other.boundary_edges.tolist())
    )
    theirs = torch.split(other.ring_vertices, other.valences.tolist())
    for v, ring in enumerate(torch.split(plain.ring_vertices, plain.valences.tolist())):
        if ring.numel():
            assert canonical_ring(new_vertex[ring].tolist()) == canonical_ring(theirs[new_vertex[v]].tolist())


# ---- size ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("closed", [False, True])
def test_a_vertex_of_huge_valence(closed: bool) -> None:
    size = 50_000
    faces = fan_faces(size)
    if closed:
        faces[-1, 2] = 1
    topology = Topology.from_faces(faces)
    ring = topology.ring_vertices[: topology.ring_offsets[1]].tolist()
    assert ring == list(range(1, size + 1 + (not closed)))
    assert bool(topology.is_boundary_vertex[0]) is not closed


def test_a_strip_of_fans() -> None:
    """Vertices of valence 1 to 40 in one mesh, each ring in order."""
    faces = []
    first = 0
    for size in range(1, 41):
        faces += (fan_faces(size) + first).tolist()
        first += size + 2
    topology = Topology.from_faces(faces)
    first = 0
    for size in range(1, 41):
        begin, end = topology.ring_offsets[first : first + 2].tolist()
        assert topology.ring_vertices[begin:end].tolist() == list(range(first + 1, first + size + 2))
        first += size + 2
