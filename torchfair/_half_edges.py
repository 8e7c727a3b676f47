"""Packs and checks faces and links their corners.

A *half-edge* is a corner of a face: corner ``h`` stands for the edge from its own vertex to the vertex of
the next corner of the same face. Arrays are indexed by half-edge unless said otherwise.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _face_hints
from ._names import Ints as Ints
from ._names import PlacedError, few, few_groups
from ._names import first_few as first_few
from .errors import MeshError

_FEW_CORNERS = 6
_MOST_VERTICES = 2**31  # keeps the products below in 64 bits and a stray huge index from eating the memory


@dataclass(frozen=True)
class HalfEdges:
    """Packed faces and what is known of their corners.

    Attributes:
        num_vertices: V.
        corners: vertex at each corner.
        offsets: (F+1,) first corner of each face.
        size: number of corners that all faces have, 0 where they differ.
    """

    num_vertices: int
    corners: Ints
    offsets: Ints
    size: int

    @cached_property
    def faces(self) -> Ints:
        """Face of each corner."""
        return face_of_corner(self.offsets)

    @cached_property
    def next(self) -> Ints:
        """Next corner of the same face."""
        following = np.arange(1, self.corners.size + 1, dtype=np.int64)
        following[self.offsets[1:] - 1] = self.offsets[:-1]
        return following

    @cached_property
    def previous(self) -> Ints:
        """The corner before, in the same face."""
        before = np.arange(-1, self.corners.size - 1, dtype=np.int64)
        before[self.offsets[:-1]] = self.offsets[1:] - 1
        return before

    @cached_property
    def heads(self) -> Ints:
        """Vertex each half-edge points to."""
        if not self.size:
            return self.corners[self.next]
        return _rolled(self.corners, self.size)

    def heads_of(self, part: slice) -> Ints:
        """Those of a run of half-edges, which begins and ends with a face where all have as many corners."""
        return _rolled(self.corners[part], self.size) if self.size else self.heads[part]

    def of_previous(self, values: Ints, kind: type[np.signedinteger[Any]]) -> npt.NDArray[Any]:
        """What the corner before each one has among the ``values`` of corners, as integers of some kind."""
        if not self.size:
            return values[self.previous].astype(kind, copy=False)
        table, found = values.reshape(-1, self.size), np.empty((len(self.offsets) - 1, self.size), kind)
        found[:, 0], found[:, 1:] = table[:, -1], table[:, :-1]
        return found.reshape(-1)

    def faces_at(self, places: Ints) -> Ints:
        """Face of some corners."""
        return places // self.size if self.size else self.faces[places]


def _rolled(corners: Ints, size: int) -> Ints:
    """The corner behind each one, in faces of as many corners."""
    table = corners.reshape(-1, size)
    return np.concatenate([table[:, 1:], table[:, :1]], axis=1).reshape(-1)


def face_of_corner(offsets: Ints) -> Ints:
    """Face of each corner."""
    return np.repeat(np.arange(offsets.size - 1, dtype=np.int64), np.diff(offsets))


def pack_faces(faces: object) -> tuple[Ints, Ints]:
    """Faces in any accepted form as ``(corners, offsets)``.

    Accepts an ``(F, k)`` array or tensor, with -1 as padding at the ends of rows, or a sequence of index sequences of
    any lengths.
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
                + (". torchfair.batches.MeshBatch.from_padded takes faces of several meshes." * (faces.ndim == 3))
            )
        return _pack_rows(faces.astype(np.int64))
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


def _pack_rows(faces: Ints) -> tuple[Ints, Ints]:
    """Rows of an array (F, k), without the corners -1 at their ends."""
    there = (faces != -1).any(1)
    if faces.size and not there[-1]:  # rows of padding behind the last face
        faces = faces[: int(np.flatnonzero(there).max(initial=-1)) + 1]
    count, size = faces.shape
    if not size or not (faces[:, -1] == -1).any():
        return faces.ravel(), np.arange(count + 1, dtype=np.int64) * size
    there = faces != -1
    sizes = there.sum(1)
    holes = np.flatnonzero((there != (np.arange(size) < sizes[:, None])).any(1))
    if holes.size:
        raise PlacedError(
            f"{holes.size} face(s) have a vertex behind padding (-1): faces ",
            few("face", holes),
            ". Put all -1 at the ends of rows.",
        )
    return faces[there], np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def build_half_edges(corners: Ints, offsets: Ints, num_vertices: int | None) -> HalfEdges:
    """Checks faces, then links each corner to its neighbours in the face."""
    half = half_edges(corners, offsets, check_faces(corners, offsets, num_vertices))
    _check_repeats(half)
    return half


def half_edges(corners: Ints, offsets: Ints, num_vertices: int) -> HalfEdges:
    """Corners of faces that have been checked."""
    sizes = np.diff(offsets)
    size = int(sizes[0]) if sizes.size and bool((sizes == sizes[0]).all()) else 0
    return HalfEdges(num_vertices, corners, offsets, size)


def check_faces(corners: Ints, offsets: Ints, num_vertices: int | None) -> int:
    """V; refuses faces of fewer than three corners and vertex numbers that do not exist."""
    sizes = np.diff(offsets)
    small = np.flatnonzero(sizes < 3)
    if small.size:
        raise PlacedError(
            f"{small.size} face(s) have fewer than three corners: faces ",
            few("face", small),
            f". Remove them from the face list.{_face_hints.of_sizes(offsets)}",
        )
    return _count_vertices(corners, offsets, num_vertices)


def _count_vertices(corners: Ints, offsets: Ints, num_vertices: int | None) -> int:
    """V as given, else one more than the largest index; refuses indices outside 0..V-1."""
    if num_vertices is None:
        num_vertices = min(int(corners.max(initial=-1)) + 1, _MOST_VERTICES)
    elif not 0 <= num_vertices <= _MOST_VERTICES:
        raise MeshError(f"num_vertices must lie between 0 and {_MOST_VERTICES}, got {num_vertices}")
    if corners.size and (corners.min() < 0 or corners.max() >= num_vertices):
        outside = np.flatnonzero((corners < 0) | (corners >= num_vertices))
        face_ids = face_of_corner(offsets)
        named = (["face ", ("face", int(face_ids[h])), f" uses vertex {corners[h]}"] for h in outside)
        raise PlacedError(
            f"vertex numbers out of range 0 <= number < {num_vertices}: ",
            few_groups(named, outside.size),
            ". Count vertices from zero and pass num_vertices if the last vertices are unused."
            + _face_hints.of_numbers(corners[outside]),
        )
    return num_vertices


def _check_repeats(half: HalfEdges) -> None:
    if 0 < half.size <= _FEW_CORNERS:  # comparing all pairs is faster than sorting
        columns = half.corners.reshape(-1, half.size).T
        equal = np.zeros(columns.shape[1], bool)
        for i, j in itertools.combinations(range(half.size), 2):
            equal |= columns[i] == columns[j]
        repeated = np.flatnonzero(equal)
    else:
        count = max(half.num_vertices, 1)
        keys = np.sort(half.faces * count + half.corners)
        repeated = np.unique(keys[1:][keys[1:] == keys[:-1]] // count)
    if repeated.size:
        raise PlacedError(
            f"{repeated.size} face(s) use a vertex more than once: faces ",
            few("face", repeated),
            ". Remove the repeated corner, or the face if fewer than three corners remain."
            + _face_hints.of_repeats(half.corners, half.offsets, repeated),
        )
