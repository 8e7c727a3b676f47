"""Packs and checks faces and links their corners.

A *half-edge* is a corner of a face: corner ``h`` stands for the edge from its own vertex to the vertex of
the next corner of the same face. Arrays are indexed by half-edge unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ._names import Ints as Ints
from ._names import PlacedError, few, few_groups
from ._names import first_few as first_few
from .errors import MeshError

_MOST_VERTICES = 2**31  # keeps the products below in 64 bits and a stray huge index from eating the memory


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


def edge_keys(tails: Ints, heads: Ints, count: int) -> Ints:
    """One number for each edge among ``count`` vertices, whichever way it is traversed."""
    keys: Ints = np.minimum(tails, heads) * np.int64(max(count, 1)) + np.maximum(tails, heads)
    return keys


def groups_of(keys: Ints) -> tuple[Ints, Ints, Ints]:
    """Equal keys as ``(order, starts, counts)``: group i is ``order[starts[i] : starts[i] + counts[i]]``."""
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    return order, starts, np.diff(np.append(starts, keys.size))


def pack_faces(faces: object) -> tuple[Ints, Ints]:
    """Faces in any accepted form as ``(corners, offsets)``.

    Accepts an ``(F, k)`` array or tensor, or a sequence of index sequences of any lengths.
    """
    if hasattr(faces, "detach"):
        faces = faces.detach().cpu().numpy()
    if isinstance(faces, np.ndarray) and faces.dtype != object:
        if faces.shape[:1] == (0,):
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
        corners = np.asarray(flat) if flat else np.zeros(0, np.int64)
    except (TypeError, ValueError) as error:
        raise MeshError(f"faces: every face must be a sequence of vertex numbers ({error})") from None
    if corners.ndim != 1 or not np.issubdtype(corners.dtype, np.integer):
        raise MeshError(f"faces: vertex numbers must be integers, got dtype {corners.dtype}")
    return corners.astype(np.int64), np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def build_half_edges(corners: Ints, offsets: Ints, num_vertices: int | None) -> HalfEdges:
    """Checks faces, then links each corner to its neighbours in the face."""
    num_vertices = check_faces(corners, offsets, num_vertices)
    face_ids = np.repeat(np.arange(offsets.size - 1, dtype=np.int64), np.diff(offsets))
    following = np.arange(1, corners.size + 1, dtype=np.int64)
    following[offsets[1:] - 1] = offsets[:-1]
    previous = np.empty_like(following)
    previous[following] = np.arange(corners.size, dtype=np.int64)
    _check_repeats(corners, face_ids, num_vertices)
    return HalfEdges(num_vertices, corners, offsets, face_ids, following, previous)


def check_faces(corners: Ints, offsets: Ints, num_vertices: int | None) -> int:
    """V; refuses faces of fewer than three corners and vertex numbers that do not exist."""
    sizes = np.diff(offsets)
    small = np.flatnonzero(sizes < 3)
    if small.size:
        raise PlacedError(
            f"{small.size} face(s) have fewer than three corners: faces ",
            few("face", small),
            ". Remove them from the face list.",
        )
    return _count_vertices(corners, np.repeat(np.arange(sizes.size, dtype=np.int64), sizes), num_vertices)


def _count_vertices(corners: Ints, face_ids: Ints, num_vertices: int | None) -> int:
    """V as given, else one more than the largest index; refuses indices outside 0..V-1."""
    if num_vertices is None:
        num_vertices = min(int(corners.max(initial=-1)) + 1, _MOST_VERTICES)
    elif not 0 <= num_vertices <= _MOST_VERTICES:
        raise MeshError(f"num_vertices must lie between 0 and {_MOST_VERTICES}, got {num_vertices}")
    outside = np.flatnonzero((corners < 0) | (corners >= num_vertices))
    if outside.size:
        named = (["face ", ("face", int(face_ids[h])), f" uses vertex {corners[h]}"] for h in outside)
        raise PlacedError(
            f"vertex numbers out of range 0 <= number < {num_vertices}: ",
            few_groups(named, outside.size),
            ". Count vertices from zero and pass num_vertices if the last vertices are unused.",
        )
    return num_vertices


def _check_repeats(corners: Ints, face_ids: Ints, num_vertices: int) -> None:
    keys = np.sort(face_ids * max(num_vertices, 1) + corners)
    repeated = np.unique(keys[1:][keys[1:] == keys[:-1]] // max(num_vertices, 1))
    if repeated.size:
        raise PlacedError(
            f"{repeated.size} face(s) use a vertex more than once: faces ",
            few("face", repeated),
            ". Remove the repeated corner, or the face if fewer than three corners remain.",
        )
