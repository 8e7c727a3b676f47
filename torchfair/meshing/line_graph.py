"""The lines of a map as a graph on the surface: nodes, edges, and their order around every node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._graph import connected
from ..fields.frames import Bools, Floats, Ints
from .chords import BrokenLinesError, Chords, LatticePoints
from .crease_darts import crease_darts
from .crease_runs import CreaseLines
from .crossings import Crossings
from .dart_ranks import crease_ranks, line_ranks
from .seamless_map import SeamlessMap

_ALONG_BOUNDARY = 2  # in place of the constant coordinate


@dataclass(frozen=True, eq=False)
class LineGraph:
    """A graph embedded in the surface, by darts: edges seen from one of their ends.

    Attributes:
        positions: (N, 3) of nodes.
        on_boundary: (N,) bool.
        at_vertex: (N,) bool: points of the lattice at vertices, singular ones among them.
        is_corner: (N,) bool: vertices on the boundary and on creases that stay.
        origin: (D,) node where a dart starts.
        twin: (D,) the same edge from its other end.
        previous: (D,) the next dart clockwise around the same node.
        coordinate: (D,) which coordinate is constant along the edge, 2 on the boundary, 3 on creases that are no lines.
        outer: (D,) bool: darts with the surface on their right.
        creases: (C, 2) nodes of the edges along creases.
    """

    positions: Floats
    on_boundary: Bools
    at_vertex: Bools
    is_corner: Bools
    origin: Ints
    twin: Ints
    previous: Ints
    coordinate: Ints
    outer: Bools
    creases: Ints


def build_line_graph(
    found: SeamlessMap, crossings: Crossings, chords: Chords, points: LatticePoints, corners: Bools, lines: CreaseLines
) -> LineGraph:
    """Joins chords over the edges of triangles, adds the boundary and creases, and sorts darts around nodes.

    Args:
        found: the map.
        crossings: of its lines with edges.
        chords: of its lines in triangles.
        points: where chords cross.
        corners: (V,) vertices on the boundary and on creases that become nodes.
        lines: creases.

    Raises:
        BrokenLinesError: if lines do not fit together.
    """
    frames, at_vertices = found.frames, found.graph.nodes
    first_vertex = len(crossings.edge)
    first_corner = first_vertex + int(at_vertices.sum()) + len(points.chords)
    name = np.full(len(frames.points), -1)
    name[at_vertices] = first_vertex + np.arange(at_vertices.sum())
    name[corners] = first_corner + np.arange(corners.sum())
    segments = _segments(crossings, chords, points, int(at_vertices.sum()))
    is_through = np.zeros(int(segments.ends.max(initial=-1)) + 1, bool)
    passes = np.zeros(frames.topology.num_edges, bool)
    passes[: len(frames.faces)] = ~lines.creases.edges
    is_through[:first_vertex] = passes[crossings.edge]
    positions = _positions(found, crossings, chords, points, corners)
    vertices = np.full(len(positions), -1)
    vertices[name[name >= 0]] = np.flatnonzero(name >= 0)
    ring = _boundary(found, crossings, name)
    along = crease_darts(frames, lines, crossings, name)
    origin, face, rank, coordinate = _join(segments, is_through)
    around = line_ranks(frames, crossings, np.flatnonzero(at_vertices), origin, face)
    parts = [
        (origin, around, rank, coordinate),
        _outline(ring),
        (along.origin, crease_ranks(frames, crossings, vertices, along), 0 * along.origin, along.coordinate),
    ]
    count, forward = len(origin), len(origin) + len(parts[1][0])
    origin, around, rank, coordinate = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((rank, around, origin))
    outer = np.zeros(len(origin), bool)
    outer[count + 1 : forward : 2] = True
    on_boundary, at_vertex, is_corner = np.zeros((3, len(positions)), bool)
    on_boundary[np.concatenate([*ring, []]).astype(np.int64)] = True
    at_vertex[name[at_vertices]] = True
    is_corner[first_corner:] = True
    previous, twin = _cyclic_previous(origin[order], order), np.arange(len(origin)) ^ 1
    edges = along.origin.reshape(-1, 2)
    return LineGraph(positions, on_boundary, at_vertex, is_corner, origin, twin, previous, coordinate, outer, edges)


@dataclass(frozen=True, eq=False)
class _Segments:
    """Pieces of chords between neighbouring nodes.

    Attributes:
        ends: (S, 2) nodes.
        faces: (S,) triangle.
        ahead: (S, 2) for both darts the place on the border of the triangle that they point to, counted on from the
            other end of the chord.
        coordinate: (S,) constant on the line.
    """

    ends: Ints
    faces: Ints
    ahead: Ints
    coordinate: Ints


def _segments(crossings: Crossings, chords: Chords, points: LatticePoints, num_singular: int) -> _Segments:
    first = len(crossings.edge) + num_singular
    count = len(points.chords)
    chord = points.chords.T.ravel()
    partner = points.chords[:, ::-1].T.ravel()
    inside = (chords.start[chord] < chords.start[partner]) & (chords.start[partner] < chords.end[chord])
    rank = np.where(inside, chords.start[partner], chords.end[partner])
    numbers = np.arange(len(chords.face))
    node = np.concatenate([chords.start_node, first + np.tile(np.arange(count), 2), chords.end_node])
    owner = np.concatenate([numbers, chord, numbers])
    rank = np.concatenate([chords.start, rank, chords.end])
    order = np.lexsort((rank, owner))
    node, owner = node[order], owner[order]
    joined = np.flatnonzero(owner[1:] == owner[:-1])
    which = owner[joined]
    ends = np.stack([node[joined], node[joined + 1]], axis=1)
    start, end = chords.start[which], chords.end[which]
    round_ = int(chords.end.max(initial=0)) + 1  # more than there are places on the border of a triangle
    return _Segments(
        ends,
        chords.face[which],
        np.stack([end, start + round_], axis=1),
        chords.coordinate[which],
    )


def _join(segments: _Segments, is_through: Bools) -> tuple[Ints, Ints, Ints, Ints]:
    """Darts of whole edges, twins one after the other: segments joined where they pass through an edge of a triangle.

    Returns:
        Their origins, faces, order within the face, and coordinates.
    """
    count = len(segments.ends)
    dart_origin = segments.ends.ravel()
    owner = np.repeat(np.arange(count), 2)
    through = np.flatnonzero(is_through[dart_origin])
    order = through[np.argsort(dart_origin[through], kind="stable")]
    if (np.bincount(dart_origin[order], minlength=len(is_through))[is_through] != 2).any():
        raise BrokenLinesError("a line of the map ends at an edge")
    a, b = owner[order[::2]], owner[order[1::2]]
    label = connected(np.stack([a, b], 1), count)
    ends = np.flatnonzero(~is_through[dart_origin])
    ends = ends[np.argsort(label[owner[ends]], kind="stable")]
    labels = label[owner[ends]]
    if len(ends) % 2 or (labels[::2] != labels[1::2]).any() or len(np.unique(labels)) != label.max(initial=-1) + 1:
        raise BrokenLinesError("a line of the map closes up without meeting another")
    which = owner[ends]
    return dart_origin[ends], segments.faces[which], segments.ahead.ravel()[ends], segments.coordinate[which]


def _boundary(found: SeamlessMap, crossings: Crossings, name: Ints) -> list[Ints]:
    """Nodes along every boundary loop."""
    topology = found.frames.topology
    starts = topology.boundary_edges.numpy()[:, 0]
    edge_from = np.zeros(topology.num_vertices, np.int64)
    edge_from[starts] = np.arange(topology.num_interior_edges, topology.num_edges)
    loops = []
    for loop in topology.boundary_loops():
        nodes: list[int] = []
        for vertex in loop.tolist():
            if name[vertex] >= 0:
                nodes.append(int(name[vertex]))
            edge = edge_from[vertex]
            nodes.extend(range(crossings.offsets[edge], crossings.offsets[edge + 1]))
        loops.append(np.array(nodes, np.int64))
    return loops


def _outline(loops: list[Ints]) -> tuple[Ints, Ints, Ints, Ints]:
    """Darts along the boundary, forward ones (the surface on the left), the first at their nodes, and backward ones."""
    origin = [np.stack([loop, np.roll(loop, -1)], axis=1).ravel() for loop in loops]
    whole = np.concatenate([*origin, []]).astype(np.int64)
    backward = np.arange(len(whole)) % 2
    around = np.where(backward, np.iinfo(np.int64).max, -1)
    return whole, around, backward, np.full(len(whole), _ALONG_BOUNDARY)


def _cyclic_previous(origin: Ints, order: Ints) -> Ints:
    """For every dart the one before it in the order around its node."""
    count = len(order)
    starts = np.flatnonzero(np.r_[True, origin[1:] != origin[:-1]]) if count else np.zeros(0, np.int64)
    before = np.arange(count) - 1
    before[starts] = np.r_[starts[1:], count] - 1
    previous = np.zeros(count, np.int64)
    previous[order] = order[before]
    return previous


def _positions(
    found: SeamlessMap, crossings: Crossings, chords: Chords, points: LatticePoints, corners: Bools
) -> Floats:
    """Nodes in space, on the triangles."""
    frames = found.frames
    start, end = frames.points[frames.topology.edges.numpy()[crossings.edge]].transpose(1, 0, 2)
    on_edges = start + crossings.along[:, None] * (end - start)
    face = chords.face[points.chords[:, 0]]
    target = chords.level[points.chords[:, 0]] + 1j * chords.level[points.chords[:, 1]]
    a, b, c = crossings.values[face].T
    area = ((b - a).conj() * (c - a)).imag
    area = np.where(area == 0, 1.0, area)
    second = ((target - a).conj() * (c - a)).imag / area
    third = ((b - a).conj() * (target - a)).imag / area
    weights = np.clip(np.stack([1 - second - third, second, third], axis=1), 0, 1)
    weights /= weights.sum(1, keepdims=True)
    inside = (weights[:, :, None] * frames.points[frames.triangles[face]]).sum(1)
    return np.concatenate([on_edges, frames.points[found.graph.nodes], inside, frames.points[corners]])
