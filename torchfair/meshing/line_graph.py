"""The lines of a map as a graph on the surface: nodes, edges, and their order around every node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._graph import connected
from ..fields.frames import Bools, FaceFrames, Floats, Ints
from .chords import BrokenLinesError, Chords, LatticePoints
from .crossings import Crossings
from .seamless_map import SeamlessMap

_ALONG_BOUNDARY = 2  # in place of the constant coordinate


@dataclass(frozen=True, eq=False)
class LineGraph:
    """A graph embedded in the surface, by darts: edges seen from one of their ends.

    Attributes:
        positions: (N, 3) of nodes.
        on_boundary, singular: (N,) bool.
        is_corner: (N,) bool: boundary vertices that stay.
        origin: (D,) node where a dart starts.
        twin: (D,) the same edge from its other end.
        previous: (D,) the next dart clockwise around the same node.
        coordinate: (D,) which coordinate is constant along the edge, 2 on the boundary.
        outer: (D,) bool: darts with the surface on their right.
    """

    positions: Floats
    on_boundary: Bools
    singular: Bools
    is_corner: Bools
    origin: Ints
    twin: Ints
    previous: Ints
    coordinate: Ints
    outer: Bools


def build_line_graph(
    found: SeamlessMap, crossings: Crossings, chords: Chords, points: LatticePoints, corners: Bools
) -> LineGraph:
    """Joins chords over the edges of triangles, adds the boundary, and sorts darts around nodes.

    Args:
        found: the map.
        crossings: of its lines with edges.
        chords: of its lines in triangles.
        points: where chords cross.
        corners: (V,) boundary vertices that become nodes.

    Raises:
        BrokenLinesError: if lines do not fit together.
    """
    frames = found.frames
    segments = _segments(crossings, chords, points, int(found.graph.singular.sum()))
    is_through = np.zeros(int(segments.ends.max(initial=-1)) + 1, bool)
    is_through[: len(crossings.edge)] = crossings.edge < len(frames.faces)
    inner = _join(segments, is_through)
    first_corner = len(crossings.edge) + int(found.graph.singular.sum()) + len(points.chords)
    ring = _boundary(found, crossings, corners, first_corner)
    outline = _outline(ring)
    darts = [np.concatenate(pair) for pair in zip(inner, outline, strict=True)]
    origin, twin, around, rank, coordinate = darts
    twin[len(inner[0]) :] += len(inner[0])
    around = _fan_ranks(found, crossings, origin, around, len(crossings.edge))
    order = np.lexsort((rank, around, origin))
    previous = _cyclic_previous(origin[order], order)
    outer = np.zeros(len(origin), bool)
    outer[len(inner[0]) + 1 :: 2] = True
    positions = _positions(found, crossings, chords, points, corners)
    count = len(positions)
    on_boundary, singular, is_corner = np.zeros((3, count), bool)
    on_boundary[np.concatenate([*ring, []]).astype(np.int64)] = True
    singular[len(crossings.edge) : len(crossings.edge) + int(found.graph.singular.sum())] = True
    is_corner[first_corner:] = True
    return LineGraph(positions, on_boundary, singular, is_corner, origin, twin, previous, coordinate, outer)


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


Darts = tuple[Ints, Ints, Ints, Ints, Ints]


def _join(segments: _Segments, is_through: Bools) -> Darts:
    """Darts of whole edges: segments joined where they pass through an edge of a triangle."""
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
    twin = np.arange(len(ends)) ^ 1
    return (dart_origin[ends], twin, segments.faces[owner[ends]], segments.ahead.ravel()[ends],
            segments.coordinate[owner[ends]])  # fmt: skip


def _boundary(found: SeamlessMap, crossings: Crossings, corners: Bools, first_corner: int) -> list[Ints]:
    """Nodes along every boundary loop."""
    topology = found.frames.topology
    name = np.cumsum(corners) - 1 + first_corner
    starts = topology.boundary_edges.numpy()[:, 0]
    edge_from = np.zeros(topology.num_vertices, np.int64)
    edge_from[starts] = np.arange(topology.num_interior_edges, topology.num_edges)
    loops = []
    for loop in topology.boundary_loops():
        nodes: list[int] = []
        for vertex in loop.tolist():
            if corners[vertex]:
                nodes.append(int(name[vertex]))
            edge = edge_from[vertex]
            nodes.extend(range(crossings.offsets[edge], crossings.offsets[edge + 1]))
        loops.append(np.array(nodes, np.int64))
    return loops


def _outline(loops: list[Ints]) -> Darts:
    """Darts along the boundary, forward ones (the surface on the left) and backward ones in turn."""
    origin = [np.stack([loop, np.roll(loop, -1)], axis=1).ravel() for loop in loops]
    whole = np.concatenate([*origin, []]).astype(np.int64)
    count = len(whole)
    backward = np.arange(count) % 2
    return (
        whole,
        np.arange(count) ^ 1,
        np.where(backward, np.iinfo(np.int64).max, -1),
        backward,
        np.full(count, _ALONG_BOUNDARY),
    )


def _fan_ranks(found: SeamlessMap, crossings: Crossings, origin: Ints, face: Ints, first: int) -> Ints:
    """Order of faces around singular vertices, counterclockwise; for other nodes one face is as good as another."""
    singular = np.flatnonzero(found.graph.singular)
    rank = np.minimum(np.maximum(face, -1), 1)
    rank[face == np.iinfo(np.int64).max] = 2
    rank[face >= 0] = np.where(face[face >= 0] == np.iinfo(np.int64).max, 2, 0)
    at = np.flatnonzero((origin >= first) & (origin < first + len(singular)))
    if not len(at):
        return rank
    order = _faces_around(found.frames, singular)
    rank[at] = [order[int(origin[dart]) - first][int(face[dart])] for dart in at]
    return rank


def _faces_around(frames: FaceFrames, vertices: Ints) -> list[dict[int, int]]:
    """For every vertex its faces with their numbers counterclockwise."""
    ring, offsets = frames.topology.ring_vertices.numpy(), frames.topology.ring_offsets.numpy()
    wanted = set(vertices.tolist())
    after: dict[tuple[int, int], int] = {}
    for face in np.flatnonzero(np.isin(frames.triangles, vertices).any(1)).tolist():
        corners = frames.triangles[face].tolist()
        for k in range(3):
            if corners[k] in wanted:
                after[corners[k], corners[(k + 1) % 3]] = face
    return [
        {after[vertex, int(other)]: number for number, other in enumerate(ring[offsets[vertex] : offsets[vertex + 1]])}
        for vertex in vertices.tolist()
    ]


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
    return np.concatenate([on_edges, frames.points[found.graph.singular], inside, frames.points[corners]])
