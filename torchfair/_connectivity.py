"""Edges, vertex rings and boundary loops of a polygon mesh, built and checked in numpy once per mesh.

Arrays are indexed by half-edge (see ``_half_edges``) unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._half_edges import HalfEdges as HalfEdges
from ._half_edges import Ints as Ints
from ._half_edges import build_half_edges as build_half_edges
from ._half_edges import edge_keys, groups_of
from ._half_edges import first_few as first_few
from ._half_edges import pack_faces as pack_faces
from ._names import Part, PlacedError, few, few_groups


@dataclass(frozen=True)
class Edges:
    """Undirected edges, interior ones first, each class sorted by its two vertex numbers."""

    vertices: Ints  # (E, 2), in the direction in which the left face traverses the edge
    faces: Ints  # (I, 2) left and right face of the interior edges
    half_edges: Ints  # (E,) the half-edge on the left
    twins: Ints  # (H,) opposite half-edge, -1 on the boundary
    corner_edges: Ints  # (H,) edge of each half-edge


def pair_half_edges(half: HalfEdges) -> tuple[Ints, Ints, Ints]:
    """Half-edges that share an edge, as ``(first, second, single)``, each sorted by the edge's vertex numbers.

    ``first`` and ``second`` are the two half-edges of the interior edges, ``single`` those of boundary edges.
    Orientation is not looked at; edges with more than two faces are refused.
    """
    order, starts, counts = groups_of(edge_keys(half.corners, half.heads, half.num_vertices))
    _check_manifold_edges(half, order, starts, counts)
    interior = starts[counts == 2]
    return order[interior], order[interior + 1], order[starts[counts == 1]]


def build_edges(half: HalfEdges) -> Edges:
    """Pairs half-edges into edges; refuses non-manifold edges and inconsistent orientation."""
    first, second, boundary = pair_half_edges(half)
    tails, heads = half.corners, half.heads
    _check_orientation(half, first, second)
    forward = tails[first] < heads[first]
    left, right = np.where(forward, first, second), np.where(forward, second, first)
    half_edges = np.concatenate([left, boundary])
    twins = np.full(tails.size, -1, np.int64)
    twins[left], twins[right] = right, left
    corner_edges = np.empty(tails.size, np.int64)
    corner_edges[half_edges] = np.arange(half_edges.size)
    corner_edges[right] = np.arange(right.size)
    return Edges(
        vertices=np.stack([tails[half_edges], heads[half_edges]], axis=1),
        faces=np.stack([half.faces[left], half.faces[right]], axis=1),
        half_edges=half_edges,
        twins=twins,
        corner_edges=corner_edges,
    )


def _check_orientation(half: HalfEdges, first: Ints, second: Ints) -> None:
    clash = np.flatnonzero(half.corners[first] == half.corners[second])
    if clash.size:
        named = (
            [*_two_faces(half, a, b), " along edge ", *edge_parts(half, int(a))]
            for a, b in zip(first[clash], second[clash], strict=True)
        )
        raise PlacedError(
            f"inconsistent orientation: {clash.size} edge(s) are traversed twice in the same direction: ",
            few_groups(named, clash.size),
            ". torchfair.repair_mesh re-orients faces that can be oriented consistently.",
        )


def _two_faces(half: HalfEdges, a: int, b: int) -> list[Part]:
    return ["faces ", ("face", int(half.faces[a])), " and ", ("face", int(half.faces[b]))]


def edge_parts(half: HalfEdges, corner: int) -> list[Part]:
    """The edge from a corner on, as it is called in a sentence."""
    return ["(", ("vertex", int(half.corners[corner])), ", ", ("vertex", int(half.heads[corner])), ")"]


def _check_manifold_edges(half: HalfEdges, order: Ints, starts: Ints, counts: Ints) -> None:
    crowded = np.flatnonzero(counts > 2)
    if crowded.size:

        def describe(c: int) -> list[Part]:
            around = np.sort(half.faces[order[starts[c] : starts[c] + counts[c]]])
            edge = edge_parts(half, int(order[starts[c]]))
            return ["edge ", *edge, " of faces [", *few("face", around), "]"]

        raise PlacedError(
            f"non-manifold: {crowded.size} edge(s) have more than two faces: ",
            few_groups((describe(int(c)) for c in crowded), crowded.size),
            ". Remove the extra faces, or torchfair.repair_mesh(..., split_edges=True) duplicates vertices.",
        )


def build_rings(half: HalfEdges, edges: Edges) -> tuple[Ints, Ints]:
    """Neighbours of every vertex in counterclockwise order, packed as ``(ring_vertices, ring_offsets)``.

    Around boundary vertices the ring starts with the boundary edge that has the surface on its left; around
    others with the edge of the first face that uses the vertex. Refuses vertices whose faces form more than
    one fan.
    """
    tails = half.corners
    is_open = edges.twins < 0
    start = np.full(half.num_vertices, -1, np.int64)
    start[tails[::-1]] = np.arange(tails.size - 1, -1, -1)
    start[tails[is_open]] = np.flatnonzero(is_open)
    around = edges.twins[half.previous]  # next outgoing half-edge, counterclockwise; -1 at the end of an open fan
    ends = around < 0
    degree = np.bincount(tails, minlength=half.num_vertices).astype(np.int64)
    remaining = _steps_to_end(np.where(around == start[tails], -1, around), int(degree.max(initial=0)))
    used = np.flatnonzero(start >= 0)
    split = used[remaining[start[used]] + 1 != degree[used]]
    if split.size:  # the chain from the start misses some faces
        raise PlacedError(
            f"non-manifold: the faces around {split.size} vertex(es) form more than one fan: vertices ",
            few("vertex", split),
            ". Duplicate such a vertex, one copy per fan, as torchfair.repair_mesh does.",
        )

    has_boundary = np.bincount(tails[is_open], minlength=half.num_vertices)
    offsets = np.concatenate([[0], np.cumsum(degree + has_boundary)])
    ring = np.empty(offsets[-1], np.int64)
    ring[offsets[tails] + degree[tails] - 1 - remaining] = half.heads
    ring[offsets[tails[ends] + 1] - 1] = tails[half.previous[ends]]
    return ring, offsets


def _steps_to_end(following: Ints, longest: int) -> Ints:
    """Steps from every link to the end of its chain of at most ``longest`` links; ``following`` is -1 at ends.

    Pointer doubling: each round doubles the distance looked ahead, so that one vertex of huge valence costs
    no more than a million ordinary ones. Links on closed chains get a meaningless number.
    """
    sentinel = following.size
    ahead = np.append(np.where(following < 0, sentinel, following), sentinel)
    steps: Ints = (ahead != sentinel).astype(np.int64)
    for _ in range(longest.bit_length()):
        steps += steps[ahead]
        ahead = ahead[ahead]
    return steps[:-1]


def build_boundary_loops(half: HalfEdges, edges: Edges) -> tuple[Ints, Ints]:
    """Boundary loops with the surface on the left, packed as ``(loop_vertices, loop_offsets)``.

    Each loop starts at its smallest vertex; loops are sorted by that vertex.
    """
    open_edges = np.flatnonzero(edges.twins < 0)
    following = dict(zip(half.corners[open_edges].tolist(), half.heads[open_edges].tolist(), strict=True))
    vertices: list[int] = []
    offsets = [0]
    for seed in sorted(following):
        if seed not in following:
            continue
        vertex = seed
        while vertex in following:
            vertices.append(vertex)
            vertex = following.pop(vertex)
        offsets.append(len(vertices))
    return np.asarray(vertices, np.int64), np.asarray(offsets, np.int64)
