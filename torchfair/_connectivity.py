"""Edges and boundary loops of a polygon mesh, built and checked in numpy once per mesh.

Arrays are indexed by half-edge (see ``_half_edges``) unless said otherwise.
"""

from __future__ import annotations

import numpy as np

from ._fans import build_rings as build_rings
from ._fans import check_fans as check_fans
from ._half_edges import HalfEdges as HalfEdges
from ._half_edges import Ints as Ints
from ._half_edges import build_half_edges as build_half_edges
from ._half_edges import first_few as first_few
from ._half_edges import pack_faces as pack_faces
from ._names import Part, PlacedError, few, few_groups
from ._paired_half_edges import Edges as Edges
from ._paired_half_edges import paired_edges
from ._sorted_keys import edge_keys, sort_keys


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
    quick = paired_edges(half)
    if quick is not None:
        return quick
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
