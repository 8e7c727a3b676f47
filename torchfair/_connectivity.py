"""Builds and checks the connectivity of a polygon mesh, in numpy, once per mesh.

A *half-edge* is a corner of a face: corner ``h`` stands for the edge from its own vertex to the vertex of
the next corner of the same face. All arrays below are indexed by half-edge unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .errors import MeshError

Ints = npt.NDArray[np.int64]

_SHOWN = 5
_REPAIR_HINT = "torchfair.repair_mesh re-orients faces that can be oriented consistently"


def first_few(items: Iterable[object], total: int) -> str:
    """The first few items as text, followed by how many were left out."""
    shown = [str(item) for item, _ in zip(items, range(_SHOWN), strict=False)]
    more = f" and {total - len(shown)} more" if total > len(shown) else ""
    return ", ".join(shown) + more


@dataclass(frozen=True)
class HalfEdges:
    """Packed faces and the half-edge arrays derived from them."""

    num_vertices: int
    corners: Ints  # vertex at each corner
    offsets: Ints  # (F+1,) first corner of each face
    faces: Ints  # face of each corner
    next: Ints  # next corner of the same face
    previous: Ints

    @property
    def heads(self) -> Ints:
        """Vertex each half-edge points to."""
        return self.corners[self.next]


@dataclass(frozen=True)
class Edges:
    """Undirected edges, interior ones first, each class sorted by its two vertex numbers."""

    vertices: Ints  # (E, 2), in the direction in which the left face traverses the edge
    faces: Ints  # (I, 2) left and right face of the interior edges
    half_edges: Ints  # (E,) the half-edge on the left
    twins: Ints  # (H,) opposite half-edge, -1 on the boundary
    corner_edges: Ints  # (H,) edge of each half-edge


def pack_faces(faces: object) -> tuple[Ints, Ints]:
    """Faces in any accepted form as ``(corners, offsets)``.

    Accepts an ``(F, k)`` array or tensor, or a sequence of index sequences of any lengths.
    """
    if hasattr(faces, "detach"):
        faces = faces.detach().cpu().numpy()
    if isinstance(faces, np.ndarray) and faces.dtype != object:
        if faces.size == 0:
            return np.zeros(0, np.int64), np.zeros(1, np.int64)
        if faces.ndim != 2 or not np.issubdtype(faces.dtype, np.integer):
            raise MeshError(
                f"faces: expected an integer array (F, k) or a sequence of index sequences, "
                f"got an array of shape {faces.shape} and dtype {faces.dtype}"
            )
        count, size = faces.shape
        return faces.astype(np.int64).ravel(), np.arange(count + 1, dtype=np.int64) * size
    if not isinstance(faces, Sequence | np.ndarray):
        raise MeshError(f"faces: expected an array or a sequence of index sequences, got {type(faces).__name__}")
    try:
        sizes = np.fromiter((len(face) for face in faces), np.int64, len(faces))
        flat = [index for face in faces for index in face]
    except TypeError as error:
        raise MeshError(f"faces: every face must be a sequence of vertex numbers ({error})") from None
    corners = np.asarray(flat) if flat else np.zeros(0, np.int64)
    if corners.ndim != 1 or not np.issubdtype(corners.dtype, np.integer):
        raise MeshError(f"faces: vertex numbers must be integers, got dtype {corners.dtype}")
    return corners.astype(np.int64), np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def build_half_edges(corners: Ints, offsets: Ints, num_vertices: int | None) -> HalfEdges:
    """Checks face sizes and indices, then links each corner to its neighbours in the face."""
    sizes = np.diff(offsets)
    small = np.flatnonzero(sizes < 3)
    if small.size:
        raise MeshError(
            f"{small.size} face(s) have fewer than three corners: faces {first_few(small, small.size)}. "
            "Remove them from the face list."
        )
    if num_vertices is None:
        num_vertices = int(corners.max()) + 1 if corners.size else 0
    face_ids = np.repeat(np.arange(sizes.size, dtype=np.int64), sizes)
    outside = np.flatnonzero((corners < 0) | (corners >= num_vertices))
    if outside.size:
        named = (f"face {face_ids[h]} uses vertex {corners[h]}" for h in outside)
        raise MeshError(
            f"vertex numbers out of range 0..{num_vertices - 1}: {first_few(named, outside.size)}. "
            "Count vertices from zero and pass num_vertices if the last vertices are unused."
        )
    following = np.arange(1, corners.size + 1, dtype=np.int64)
    following[offsets[1:] - 1] = offsets[:-1]
    previous = np.empty_like(following)
    previous[following] = np.arange(corners.size, dtype=np.int64)
    _check_repeats(corners, face_ids, num_vertices)
    return HalfEdges(num_vertices, corners, offsets, face_ids, following, previous)


def _check_repeats(corners: Ints, face_ids: Ints, num_vertices: int) -> None:
    keys = np.sort(face_ids * max(num_vertices, 1) + corners)
    repeated = np.unique(keys[1:][keys[1:] == keys[:-1]] // max(num_vertices, 1))
    if repeated.size:
        raise MeshError(
            f"{repeated.size} face(s) use a vertex more than once: faces {first_few(repeated, repeated.size)}. "
            "Remove the repeated corner, or the face if fewer than three corners remain."
        )


def build_edges(half: HalfEdges) -> Edges:
    """Pairs half-edges into edges; refuses non-manifold edges and inconsistent orientation."""
    tails, heads = half.corners, half.heads
    forward = tails < heads
    keys = np.where(forward, tails, heads) * max(half.num_vertices, 1) + np.where(forward, heads, tails)
    order = np.argsort(keys, kind="stable")
    sorted_keys = keys[order]
    starts = np.flatnonzero(np.r_[True, sorted_keys[1:] != sorted_keys[:-1]]) if keys.size else np.zeros(0, np.int64)
    counts = np.diff(np.r_[starts, keys.size])
    _check_manifold_edges(half, order, starts, counts)

    interior = counts == 2
    first = order[starts[interior]]
    second = order[starts[interior] + 1]
    clash = np.flatnonzero(forward[first] == forward[second])
    if clash.size:
        named = (
            f"faces {half.faces[first[c]]} and {half.faces[second[c]]} along edge "
            f"({tails[first[c]]}, {heads[first[c]]})"
            for c in clash
        )
        raise MeshError(
            f"inconsistent orientation: {clash.size} edge(s) are traversed twice in the same direction: "
            f"{first_few(named, clash.size)}. {_REPAIR_HINT}."
        )
    left = np.where(forward[first], first, second)
    right = np.where(forward[first], second, first)
    boundary = order[starts[~interior]]
    half_edges = np.concatenate([left, boundary])
    twins = np.full(keys.size, -1, np.int64)
    twins[left], twins[right] = right, left
    corner_edges = np.empty(keys.size, np.int64)
    corner_edges[half_edges] = np.arange(half_edges.size)
    corner_edges[right] = np.arange(right.size)
    return Edges(
        vertices=np.stack([tails[half_edges], heads[half_edges]], axis=1),
        faces=np.stack([half.faces[left], half.faces[right]], axis=1),
        half_edges=half_edges,
        twins=twins,
        corner_edges=corner_edges,
    )


def _check_manifold_edges(half: HalfEdges, order: Ints, starts: Ints, counts: Ints) -> None:
    crowded = np.flatnonzero(counts > 2)
    if crowded.size:

        def describe(c: int) -> str:
            around = half.faces[order[starts[c] : starts[c] + counts[c]]]
            h = order[starts[c]]
            return f"edge ({half.corners[h]}, {half.heads[h]}) of faces {sorted(around.tolist())}"

        raise MeshError(
            f"non-manifold: {crowded.size} edge(s) have more than two faces: "
            f"{first_few((describe(int(c)) for c in crowded), crowded.size)}. "
            "Remove the extra faces or duplicate the vertices of the edge."
        )


def build_rings(half: HalfEdges, edges: Edges) -> tuple[Ints, Ints]:
    """Neighbours of every vertex in counterclockwise order, packed as ``(ring_vertices, ring_offsets)``.

    Around boundary vertices the ring starts with the boundary edge that has the surface on its left.
    Refuses vertices whose faces form more than one fan.
    """
    tails = half.corners
    degree = np.bincount(tails, minlength=half.num_vertices).astype(np.int64)
    around = edges.twins[half.previous]  # next outgoing half-edge, counterclockwise; -1 at the end of an open fan
    is_open = edges.twins < 0
    start = np.full(half.num_vertices, -1, np.int64)
    start[tails[::-1]] = np.arange(tails.size - 1, -1, -1)
    start[tails[is_open]] = np.flatnonzero(is_open)
    _check_open_fans(half, is_open)
    has_boundary = np.zeros(half.num_vertices, bool)
    has_boundary[tails[is_open]] = True

    offsets = np.concatenate([[0], np.cumsum(degree + has_boundary)])
    ring = np.empty(offsets[-1], np.int64)
    active = np.flatnonzero(start >= 0)
    current, step = start[active], 0
    visited = np.zeros(half.num_vertices, np.int64)
    while active.size:
        ring[offsets[active] + step] = half.heads[current]
        visited[active] += 1
        last = around[current] < 0
        ended = active[last]
        ring[offsets[ended] + step + 1] = tails[half.previous[current[last]]]
        going = ~last & (around[current] != start[active])
        active, current = active[going], around[current[going]]
        step += 1
    split = np.flatnonzero(visited != degree)
    if split.size:
        _raise_split_vertices(split)
    return ring, offsets


def _check_open_fans(half: HalfEdges, is_open: npt.NDArray[np.bool_]) -> None:
    fans = np.bincount(half.corners[is_open], minlength=half.num_vertices)
    split = np.flatnonzero(fans > 1)
    if split.size:
        _raise_split_vertices(split)


def _raise_split_vertices(split: Ints) -> None:
    raise MeshError(
        f"non-manifold: the faces around {split.size} vertex(es) form more than one fan: "
        f"vertices {first_few(split, split.size)}. Duplicate such a vertex, one copy per fan."
    )


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
