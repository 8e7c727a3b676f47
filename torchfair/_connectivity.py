"""Edges, vertex rings and boundary loops of a polygon mesh, built and checked in numpy once per mesh.

Arrays are indexed by half-edge (see ``_half_edges``) unless said otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._half_edges import HalfEdges as HalfEdges
from ._half_edges import Ints as Ints
from ._half_edges import build_half_edges as build_half_edges
from ._half_edges import edge_keys, sort_keys
from ._half_edges import first_few as first_few
from ._half_edges import pack_faces as pack_faces
from ._names import Part, PlacedError, few, few_groups

_MOST_STEPS = 16  # faces around a vertex, as there are few with more


@dataclass(frozen=True)
class Edges:
    """Undirected edges, interior ones first, each class sorted by its two vertex numbers."""

    vertices: Ints  # (E, 2), in the direction in which the left face traverses the edge
    faces: Ints  # (I, 2) left and right face of the interior edges
    twins: Ints  # (H,) opposite half-edge, -1 on the boundary
    corner_edges: Ints  # (H,) edge of each half-edge


def pair_half_edges(half: HalfEdges) -> tuple[Ints, Ints, Ints]:
    """Half-edges that share an edge, as ``(first, second, single)``, each sorted by the edge's vertex numbers.

    ``first`` and ``second`` are the two half-edges of the interior edges, ``single`` those of boundary edges.
    Orientation is not looked at; edges with more than two faces are refused.
    """
    order, keys = sort_keys(edge_keys(half.corners, half.heads, half.num_vertices))
    as_next = np.append(keys[1:] == keys[:-1], False)[: keys.size]  # whether the next one has the same edge
    as_before = np.roll(as_next, 1)
    if (as_next & as_before).any():
        _refuse_crowded_edges(half, order, keys)
    return order[as_next], order[as_before], order[~(as_next | as_before)]


def build_edges(half: HalfEdges) -> Edges:
    """Pairs half-edges into edges; refuses non-manifold edges and inconsistent orientation."""
    first, second, boundary = pair_half_edges(half)
    tails, heads = half.corners, half.heads
    starts = tails[first]
    _check_orientation(half, first, second, starts)
    forward = starts < heads[first]
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
        twins=twins,
        corner_edges=corner_edges,
    )


def _check_orientation(half: HalfEdges, first: Ints, second: Ints, starts: Ints) -> None:
    clash = np.flatnonzero(starts == half.corners[second])
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


def _refuse_crowded_edges(half: HalfEdges, order: Ints, keys: Ints) -> None:
    starts = np.flatnonzero(np.diff(keys, prepend=-1))
    counts = np.diff(np.append(starts, keys.size))
    crowded = np.flatnonzero(counts > 2)

    def describe(c: int) -> list[Part]:
        around = np.sort(half.faces[order[starts[c] : starts[c] + counts[c]]])
        edge = edge_parts(half, int(order[starts[c]]))
        return ["edge ", *edge, " of faces [", *few("face", around), "]"]

    raise PlacedError(
        f"non-manifold: {crowded.size} edge(s) have more than two faces: ",
        few_groups((describe(int(c)) for c in crowded), crowded.size),
        ". Remove the extra faces, or torchfair.repair_mesh(..., split_edges=True) duplicates vertices.",
    )


@dataclass(frozen=True)
class Fans:
    """How the faces around each vertex follow each other.

    Attributes:
        degree: (V,) number of faces.
        start: (V,) half-edge of each vertex to begin with, -1 at isolated ones: the boundary edge that has the surface
            on its left, or around others the edge of the first face that uses the vertex.
        around: (H,) next outgoing half-edge, counterclockwise; -1 at the end of an open fan.
    """

    degree: Ints
    start: Ints
    around: Ints


def _fans(half: HalfEdges, twins: Ints) -> Fans:
    tails, is_open = half.corners, np.flatnonzero(twins < 0)
    start = np.full(half.num_vertices, -1, np.int64)
    start[tails[::-1]] = np.arange(tails.size - 1, -1, -1)
    start[tails[is_open]] = is_open
    degree = np.bincount(tails, minlength=half.num_vertices)
    return Fans(degree, start, twins[half.previous])


def check_fans(half: HalfEdges, twins: Ints) -> None:
    """Refuses vertices whose faces form more than one fan.

    It goes around all vertices at once, face by face; vertices of many faces are left to :func:`build_rings`.
    """
    fans = _fans(half, twins)
    vertices = np.flatnonzero(fans.start >= 0)
    first = at = fans.start[vertices]
    for passed in range(1, min(int(fans.degree.max(initial=0)), _MOST_STEPS) + 1):
        at = fans.around[at]
        going = (at >= 0) & (at != first)
        _refuse_fans(vertices[~going & (fans.degree[vertices] != passed)])
        vertices, first, at = vertices[going], first[going], at[going]
    if vertices.size:
        build_rings(half, twins)


def _refuse_fans(split: Ints) -> None:
    if split.size:
        raise PlacedError(
            f"non-manifold: the faces around {split.size} vertex(es) form more than one fan: vertices ",
            few("vertex", split),
            ". Duplicate such a vertex, one copy per fan, as torchfair.repair_mesh does.",
        )


def build_rings(half: HalfEdges, twins: Ints) -> tuple[Ints, Ints]:
    """Neighbours of every vertex in counterclockwise order, packed as ``(ring_vertices, ring_offsets)``.

    Around boundary vertices the ring starts with the boundary edge that has the surface on its left; around
    others with the edge of the first face that uses the vertex. Refuses vertices whose faces form more than
    one fan.
    """
    fans = _fans(half, twins)
    tails, start, degree, around = half.corners, fans.start, fans.degree, fans.around
    ends = around < 0
    remaining = _steps_to_end(np.where(around == start[tails], -1, around), int(degree.max(initial=0)))
    used = np.flatnonzero(start >= 0)
    _refuse_fans(used[remaining[start[used]] + 1 != degree[used]])  # the chain from the start misses some faces
    has_boundary = np.bincount(tails[twins < 0], minlength=half.num_vertices)
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


def build_boundary_loops(boundary_edges: Ints) -> tuple[Ints, Ints]:
    """Boundary loops with the surface on the left, packed as ``(loop_vertices, loop_offsets)``.

    Each loop starts at its smallest vertex; loops are sorted by that vertex.
    """
    following = dict(boundary_edges.tolist())
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
