"""Crosses whose two directions stay apart from each other, so that rows of a lattice can follow one of them."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from ..fields import Directions, FaceFrames, loop_charges, vertex_charges
from ..fields.frames import Bools, Floats, Ints
from ..fields.merging import carried_charges, refitted

_RINGS = 1  # of triangles around a path, in which crosses need not follow the principal directions


def even_crosses(
    frames: FaceFrames,
    angles: Floats,
    matched: Ints,
    directions: Directions,
    smoothing: float,
    weight: float,
    stay: Bools | None = None,
) -> tuple[Floats, Ints]:
    """Crosses with no more vertices of index 1/4 or -1/4: those are joined in pairs, by short paths.

    Around an odd index the directions of a cross change places. Principal directions do so where an umbilic line ends,
    as on the rounded edges of a corner: larger and smaller curvature change places across the line, directions do not
    turn. Rows that follow the larger curvature would turn by a right angle there; rows that follow crosses go on.
    Where two such vertices are joined, crosses turn by a right angle along the path between them. Boundary loops
    against which crosses make an odd number of quarter turns take part. What is odd along handles stays odd.

    Args:
        frames: of the triangles.
        angles: (F,) of the field.
        matched: (I,) quarter turns over edges.
        directions: principal directions.
        smoothing: as for the field.
        weight: of the length of paths, beside that of the confidence of directions along them.
        stay: (V,) bool: vertices that take the index of both rather than another on the path. None by default.

    Returns:
        Angles (F,) and matchings (I,).
    """
    charges = vertex_charges(frames, angles, matched)
    odd_loops = np.rint(loop_charges(frames, angles, matched)).astype(np.int64) % 2 == 1
    loops = [loop.numpy() for loop, odd in zip(frames.topology.boundary_loops(), odd_loops, strict=True) if odd]
    ends = [np.array([vertex]) for vertex in np.flatnonzero(charges % 2)] + loops
    if len(ends) < 2:
        return angles, matched
    trust = frames.at_vertices(directions.confidence)
    lengths, before = _shortest_paths(frames, ends, weight + trust)
    rank = trust if stay is None else np.where(stay, -1.0, trust)
    steps: list[tuple[int, int, int]] = []
    touched = np.zeros(len(frames.points), bool)
    for first, second in closest_pairs(_between(lengths, ends)):
        path = _path(before[first], lengths[first], ends[second])
        start, end = (int(charges[path[at]]) or 1 for at in (0, -1))
        meeting = int(np.argmin(np.where(frames.is_boundary[path], -2.0, rank[path])))
        steps += [(a, b, start) for a, b in itertools.pairwise(path[: meeting + 1])]
        steps += [(b, a, end) for a, b in itertools.pairwise(path[meeting:])]
        touched[path] = True
    moved = carried_charges(frames, matched, steps)
    return refitted(frames, angles, moved, directions, smoothing, touched, 4, _RINGS), moved


def closest_pairs(lengths: Floats) -> list[tuple[int, int]]:
    """Pairs of things with a small sum of distances (n, n): the nearest first, then changed two by two while it falls.

    One of an odd number is left over.
    """
    rows, columns = np.triu_indices(len(lengths), 1)
    free, pairs = set(range(len(lengths))), []
    for at in np.argsort(lengths[rows, columns], kind="stable"):
        pair = int(rows[at]), int(columns[at])
        if free.issuperset(pair) and np.isfinite(lengths[pair]):
            pairs.append(pair)
            free -= set(pair)
    falls = True
    while falls:
        falls = False
        for i, j in itertools.combinations(range(len(pairs)), 2):
            (a, b), (c, d) = pairs[i], pairs[j]
            least = (1 - 1e-9) * (lengths[a, b] + lengths[c, d])
            for one, other in (((a, c), (b, d)), ((a, d), (b, c))):
                if lengths[one] + lengths[other] < least:
                    pairs[i], pairs[j], falls = one, other, True
                    least = (1 - 1e-9) * (lengths[one] + lengths[other])
    return pairs


def _shortest_paths(frames: FaceFrames, ends: list[Ints], weights: Floats) -> tuple[Floats, Ints]:
    """(n, V) lengths of the shortest paths from sets of vertices to all, and the vertex before each on them.

    Along edges, but not those from boundary to boundary, with lengths weighted by (V,).
    """
    inner = ~frames.is_boundary[frames.edges].all(1)
    (v, w), lengths = frames.edges[inner].T, frames.lengths[inner]
    lengths = lengths * weights[frames.edges[inner]].mean(1)
    graph = sp.csr_matrix((np.r_[lengths, lengths], (np.r_[v, w], np.r_[w, v])), shape=(len(frames.points),) * 2)
    found = [dijkstra(graph, indices=of, return_predecessors=True, min_only=True)[:2] for of in ends]
    return np.stack([of for of, _ in found]), np.stack([of for _, of in found])


def _between(lengths: Floats, ends: list[Ints]) -> Floats:
    return np.stack([lengths[:, of].min(1) for of in ends], axis=1)


def _path(before: Ints, lengths: Floats, end: Ints) -> Ints:
    """Vertices from where a search began to the nearest of an end."""
    path = [int(end[np.argmin(lengths[end])])]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1])
