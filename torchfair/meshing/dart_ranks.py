"""In which order edges leave the nodes of the graph of lines, counterclockwise."""

from __future__ import annotations

import numpy as np

from ..fields.frames import FaceFrames, Ints
from .crease_darts import CreaseDarts
from .crossings import Crossings


def line_ranks(frames: FaceFrames, crossings: Crossings, vertices: Ints, origin: Ints, face: Ints) -> Ints:
    """Ranks of darts along lines by their faces, whose order within a face is another matter.

    At vertices faces have odd numbers and edges even ones; at crossings the left face has 1 and the right one 3, the
    edge ahead 0 and back 2. Elsewhere all are in one face.

    Args:
        frames: of the triangles.
        crossings: of lines with edges.
        vertices: of the nodes after those that are crossings.
        origin: (D,) node where a dart starts.
        face: (D,) in which it starts.
    """
    first = len(crossings.edge)
    rank = np.ones(len(origin), np.int64)
    at_edge = np.flatnonzero(origin < first)
    edge = crossings.edge[origin[at_edge]]
    inner = edge < len(frames.faces)
    at_edge, edge = at_edge[inner], edge[inner]
    rank[at_edge] = np.where(face[at_edge] == frames.faces[edge, 0], 1, 3)
    at_vertex = np.flatnonzero((origin >= first) & (origin < first + len(vertices)))
    if len(at_vertex):
        order = _around(frames, vertices)
        rank[at_vertex] = [order[int(vertices[origin[d] - first])][0][int(face[d])] for d in at_vertex]
    return rank


def crease_ranks(frames: FaceFrames, crossings: Crossings, vertices: Ints, darts: CreaseDarts) -> Ints:
    """Ranks of darts along creases, see :func:`line_ranks`.

    Args:
        frames: of the triangles.
        crossings: of lines with edges.
        vertices: (N,) of all nodes, -1 where they are at none.
        darts: along creases.
    """
    rank = np.where(darts.along, 0, 2)
    at = vertices[darts.origin]
    if (at >= 0).any():
        order = _around(frames, np.unique(at[at >= 0]))
        ends = np.where(darts.along, frames.edges[darts.edge, 1], frames.edges[darts.edge, 0])
        for dart in np.flatnonzero(at >= 0).tolist():
            rank[dart] = order[int(at[dart])][1][int(ends[dart])]
    return np.asarray(rank, np.int64)


def _around(frames: FaceFrames, vertices: Ints) -> dict[int, tuple[dict[int, int], dict[int, int]]]:
    """For every vertex the ranks of its faces and of its neighbours, counterclockwise."""
    ring, offsets = frames.topology.ring_vertices.numpy(), frames.topology.ring_offsets.numpy()
    wanted = set(vertices.tolist())
    after: dict[tuple[int, int], int] = {}
    for face in np.flatnonzero(np.isin(frames.triangles, vertices).any(1)).tolist():
        corners = frames.triangles[face].tolist()
        for k in range(3):
            if corners[k] in wanted:
                after[corners[k], corners[(k + 1) % 3]] = face
    found = {}
    for vertex in vertices.tolist():
        others = ring[offsets[vertex] : offsets[vertex + 1]].tolist()
        faces = {after[vertex, o]: 2 * k + 1 for k, o in enumerate(others) if (vertex, o) in after}
        found[vertex] = faces, {other: 2 * number for number, other in enumerate(others)}
    return found
