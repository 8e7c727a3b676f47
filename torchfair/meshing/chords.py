"""Lines of whole numbers inside triangles, and the lattice points where they cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._ranges import ranges
from ..errors import MeshError
from ..fields.frames import Bools, Ints
from .crossings import Crossings, sorted_groups
from .seamless_map import SeamlessMap


class BrokenLinesError(MeshError):
    """Lines of a map do not fit together; the map has triangles turned over where they pass."""


@dataclass(frozen=True, eq=False)
class Chords:
    """Pieces of lines inside triangles, each between two places on the border of its triangle.

    Places are numbered counterclockwise around every triangle, face after face. Nodes are crossings, then
    vertices that are nodes.

    Attributes:
        face, coordinate, level: (C,).
        start, end: (C,) places, the smaller first.
        start_node, end_node: (C,).
    """

    face: Ints
    coordinate: Ints
    level: Ints
    start: Ints
    end: Ints
    start_node: Ints
    end_node: Ints


@dataclass(frozen=True, eq=False)
class LatticePoints:
    """Crossings of two chords inside a triangle.

    Attributes:
        chords: (P, 2) the chord with the first and with the second coordinate constant.
        places: (P, 4) the ends of both chords, in counterclockwise order.
    """

    chords: Ints
    places: Ints


def find_chords(found: SeamlessMap, crossings: Crossings, creases: Bools) -> Chords:
    """The chords of all triangles, by joining crossings of the same line on the border of a triangle.

    Args:
        found: the map.
        crossings: of its lines with edges.
        creases: (I,) bool: edges that are curves of their own.

    Raises:
        BrokenLinesError: if a line enters a triangle and does not leave it.
    """
    face, side, rank, node, coordinate, level = _border(found, crossings)
    order, new = sorted_groups(face, side, rank)
    place = np.cumsum(new) - 1
    face, node, coordinate, level = face[order], node[order], coordinate[order], level[order]
    order, new = sorted_groups(face, coordinate, level, place)
    starts = np.flatnonzero(np.r_[new[:1], _changes(face, coordinate, level, order)])
    counts = np.diff(np.r_[starts, len(order)])
    from_vertex = node[order[starts]] >= len(crossings.edge)
    if (counts > 2).any() or ((counts == 1) & ~from_vertex).any():
        raise BrokenLinesError("lines of the map end inside the surface")
    pairs = starts[counts == 2]
    a, b = order[pairs], order[pairs + 1]
    once = ~_are_there_already(found, face[a], node[a], node[b], len(crossings.edge), creases)
    a, b = a[once], b[once]
    return Chords(face[a], coordinate[a], level[a], place[a], place[b], node[a], node[b])


def _are_there_already(
    found: SeamlessMap, face: Ints, first: Ints, second: Ints, first_vertex: int, creases: Bools
) -> Bools:
    """Which chords join two vertices, so that they are edges, and lie in the right face of the edge or on a crease."""
    frames = found.frames
    vertices = np.flatnonzero(found.graph.nodes)
    again = np.zeros(len(face), bool)
    for chord in np.flatnonzero((first >= first_vertex) & (second >= first_vertex)).tolist():
        ends = set(vertices[[first[chord] - first_vertex, second[chord] - first_vertex]].tolist())
        corners = frames.triangles[face[chord]].tolist()
        side = next(k for k in range(3) if {corners[k], corners[(k + 1) % 3]} == ends)
        edge = int(frames.topology.corner_edges[3 * int(face[chord]) + side])
        again[chord] = frames.faces[edge, 0] != face[chord] or creases[edge]
    return again


def _changes(face: Ints, coordinate: Ints, level: Ints, order: Ints) -> np.ndarray:
    return np.asarray(np.any([key[order][1:] != key[order][:-1] for key in (face, coordinate, level)], axis=0))


def _border(found: SeamlessMap, crossings: Crossings) -> tuple[Ints, ...]:
    """Everything on the borders of triangles: face, side, rank along the side, node, and the line."""
    frames = found.frames
    face, corner = frames.left_corners
    edge, count = crossings.edge, len(crossings.edge)
    number = np.arange(count)
    rank = number - crossings.offsets[edge] + 1
    inner = np.flatnonzero(edge < len(frames.faces))
    right = edge[inner]
    back = crossings.offsets[right + 1] - number[inner]
    triangle, at = np.nonzero(found.graph.nodes[frames.triangles])
    name = np.cumsum(found.graph.nodes) - 1 + count
    value = crossings.values[triangle, at]
    node = name[frames.triangles[triangle, at]]
    first, second = np.zeros_like(at), np.ones_like(at)
    parts = [
        (face[edge], corner[edge], rank, number, crossings.coordinate[:, 0], crossings.level[:, 0]),
        (frames.faces[right, 1], frames.corners[right, 1], back, inner, crossings.coordinate[inner, 1],
         crossings.level[inner, 1]),
        (triangle, at, first, node, first, np.rint(value.real).astype(np.int64)),
        (triangle, at, first, node, second, np.rint(value.imag).astype(np.int64)),
    ]  # fmt: skip
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


def find_lattice_points(chords: Chords, num_faces: int) -> LatticePoints:
    """Where chords of both coordinates cross: their ends alternate around the triangle."""
    by_face = [np.flatnonzero(chords.coordinate == k) for k in (0, 1)]
    by_face = [which[np.argsort(chords.face[which], kind="stable")] for which in by_face]
    counts = [np.bincount(chords.face[which], minlength=num_faces) for which in by_face]
    offsets = [np.cumsum(count) - count for count in counts]
    pairs = counts[0] * counts[1]
    face = np.repeat(np.arange(num_faces), pairs)
    within = ranges(np.zeros_like(pairs), pairs)
    width = np.maximum(counts[1], 1)[face]
    a = by_face[0][offsets[0][face] + within // width] if len(face) else face
    b = by_face[1][offsets[1][face] + within % width] if len(face) else face
    a_first = (chords.start[a] < chords.start[b]) & (chords.start[b] < chords.end[a]) & (chords.end[a] < chords.end[b])
    b_first = (chords.start[b] < chords.start[a]) & (chords.start[a] < chords.end[b]) & (chords.end[b] < chords.end[a])
    crossed = a_first | b_first
    both = np.stack([a, b], axis=1)[crossed]
    places = np.sort(np.concatenate([chords.start[both], chords.end[both]], axis=1), axis=1)
    return LatticePoints(both, places)
