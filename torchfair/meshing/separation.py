"""Singular vertices that are near each other are not rounded to one point."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from ..fields.frames import Bools, FaceFrames, Floats, Ints
from .closest_vectors import closest_vectors
from .cut_graph import CutGraph, dual_graph
from .seams import ROTATIONS, Seams

_WEIGHT = 1e3  # of a step that is asked for, over the largest of the metric
_PAIRS = 100  # looked at: rough surfaces have thousands, and no lattice that keeps all of them apart
_ROUNDS = 8


def gaps(frames: FaceFrames, graph: CutGraph, seams: Seams, radius: float) -> sp.csr_matrix:
    """(n, N) complex: differences of the values of two nodes, in one frame, by those of copies.

    Args:
        frames: of the triangles.
        graph: the cut.
        seams: its copies.
        radius: pairs that are farther from each other on the surface are left out; of many the nearest hundred stay.
    """
    singular = np.flatnonzero(graph.nodes)
    if len(singular) < 2:
        return sp.csr_matrix(np.zeros((0, len(seams.vertex)), complex))
    at = [np.flatnonzero((frames.triangles == vertex).any(1)) for vertex in singular]
    starts = np.array([faces[0] for faces in at])
    distance, before = dijkstra(dual_graph(frames), indices=starts, limit=radius, return_predecessors=True)
    nearest = np.stack([faces[np.argmin(distance[:, faces], axis=1)] for faces in at], axis=1)
    gap = np.triu(np.take_along_axis(distance, nearest, axis=1), 1)
    pairs = np.argwhere(np.isfinite(gap) & np.triu(np.ones(gap.shape, bool), 1))
    closest = np.sort(np.argsort(gap[tuple(pairs.T)], kind="stable")[:_PAIRS])
    rows = []
    for first, second in pairs[closest].tolist():
        path = [int(nearest[first, second])]
        while path[-1] != starts[first]:
            path.append(int(before[first, path[-1]]))
        rows.append(_gap(frames, graph, seams, path[::-1], int(singular[first]), int(singular[second])))
    places = [(row, copy, number) for row, terms in enumerate(rows) for copy, number in terms.items()]
    numbers = np.array([number for _, _, number in places], complex)
    where = np.array([(row, copy) for row, copy, _ in places], np.int64).reshape(-1, 2).T
    return sp.csr_matrix((numbers, where), shape=(len(rows), len(seams.vertex)))


def _gap(
    frames: FaceFrames, graph: CutGraph, seams: Seams, path: list[int], start: int, end: int
) -> dict[int, complex]:
    """Value at the end less that at the start, by copies, along faces that share edges, in the frame of the first."""
    terms: dict[int, complex] = {}
    back: complex = 1.0  # from the frame of the face to that of the first

    def step(face: int, from_vertex: int, to_vertex: int) -> None:
        corners = frames.triangles[face].tolist()
        for vertex, sign in ((to_vertex, 1), (from_vertex, -1)):
            copy = int(seams.copies[face, corners.index(vertex)])
            terms[copy] = terms.get(copy, 0) + sign * back

    here = start
    for face, other in itertools.pairwise(path):
        shared = np.intersect1d(
            frames.topology.corner_edges.numpy()[3 * face : 3 * face + 3],
            frames.topology.corner_edges.numpy()[3 * other : 3 * other + 3],
        )
        edge = int(shared[0])
        vertex = int(frames.edges[edge, 0])
        step(face, here, vertex)
        turn = complex(ROTATIONS[graph.quarters[edge]])
        back = back * (turn.conjugate() if frames.faces[edge, 0] == face else turn)
        here = vertex
    step(path[-1], here, end)
    return terms


def separate_vectors(metric: Floats, target: Floats, rows: Floats, offsets: Floats) -> Ints:
    """Whole vectors (m, k) close to a target that keep pairs apart, the closest first; if there are none, any.

    Where two singular vertices would come to lie on one point, a step of one is asked for along the coordinate in
    which they are farther from each other at the target.

    Args:
        metric: (k, k) positive definite, of eigenvalues up to 1.
        target: (k,).
        rows: (2n, k) of both coordinates of every gap by whole vectors.
        offsets: (2n,) what is added to them.
    """
    vectors = closest_vectors(metric, target).vectors
    wanted = (rows @ target + offsets).reshape(-1, 2)
    stiff, right = metric, metric @ target
    done: set[int] = set()
    for _ in range(min(len(wanted), _ROUNDS)):
        new = set(np.flatnonzero(_together(rows, offsets, vectors[0])).tolist()) - done
        if not new:
            break
        for pair in sorted(new):
            part = int(np.argmax(np.abs(wanted[pair])))
            row = rows[2 * pair + part]
            ahead = 1.0 if wanted[pair, part] >= 0 else -1.0
            stiff = stiff + _WEIGHT * np.outer(row, row)
            right = right + _WEIGHT * row * (ahead - offsets[2 * pair + part])
        done |= new
        centre = np.asarray(np.linalg.lstsq(stiff, right, rcond=None)[0], np.float64)
        vectors = closest_vectors(stiff, centre).vectors
    apart = np.array([not _together(rows, offsets, vector).any() for vector in vectors])
    return vectors[apart] if apart.any() else vectors


def _together(rows: Floats, offsets: Floats, vector: Ints) -> Bools:
    return np.asarray(~np.rint(rows @ vector + offsets).reshape(-1, 2).any(1))
