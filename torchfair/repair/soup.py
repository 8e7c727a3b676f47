"""Polygons that are not a manifold mesh yet, and where each part of them came from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from .._names import Ints, Part, PlacedError, Sentence, few, sentence
from .._sorted_keys import edge_keys, groups_of

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Soup:
    """Polygons with provenance; every repair makes another one.

    Attributes:
        unit: A power of two, by which positions are divided, so that nothing over- or underflows.
        points: (V, B, 3) positions of B meshes with the same faces, at most 2.
        corners, offsets: Packed faces.
        vertices: (V,) vertex of the input that each one was, or is a copy of.
        faces: (F,) face of the input that each one was.
        origins: (H,) corner of the input that each one was; -1 for one that was put in.
        merged: (V,) vertex that each one was merged into; itself where it was not.
        said: What was done, in numbers of the input.
    """

    unit: float
    points: Floats
    corners: Ints
    offsets: Ints
    vertices: Ints
    faces: Ints
    origins: Ints
    merged: Ints
    said: tuple[Sentence, ...] = ()

    @classmethod
    def of(cls, points: Floats, corners: Ints, offsets: Ints) -> Soup:
        """The input.

        Raises:
            MeshError: the position of a vertex of a face is not finite.
        """
        bad = np.flatnonzero(~np.isfinite(points).all((1, 2)))
        bad = np.intersect1d(bad, corners)
        if bad.size:
            raise PlacedError(f"{bad.size} vertex(es) are not finite: vertices ", few("vertex", bad), ".")
        vertices, faces = np.arange(len(points)), np.arange(len(offsets) - 1)
        largest = float(np.abs(points[corners]).max(initial=0.0))
        unit = 2.0 ** max(float(np.frexp(largest)[1] - 1), -1021.0) if largest else 1.0
        return cls(unit, points / unit, corners, offsets, vertices, faces, np.arange(len(corners)), vertices)

    @property
    def sizes(self) -> Ints:
        """(F,) number of corners."""
        return np.diff(self.offsets)

    @property
    def corner_faces(self) -> Ints:
        """(H,) face of each corner."""
        return np.repeat(np.arange(len(self.faces)), self.sizes)

    @property
    def heads(self) -> Ints:
        """(H,) vertex at the next corner of the same face."""
        following = np.arange(1, len(self.corners) + 1)
        following[self.offsets[1:] - 1] = self.offsets[:-1]
        heads: Ints = self.corners[following]
        return heads

    @cached_property
    def rim(self) -> Ints:
        """Corners from which edges of the boundary run, in order."""
        order, starts, counts = groups_of(edge_keys(self.corners, self.heads, len(self.points)))
        rim: Ints = np.sort(order[starts[counts == 1]])
        return rim

    @property
    def rim_vertices(self) -> Ints:
        """Ends of the edges of the boundary, in order."""
        return np.unique(np.concatenate([self.corners[self.rim], self.heads[self.rim]]))

    @property
    def extent(self) -> float:
        """Largest side of the bounding boxes of what is used."""
        used = self.points[np.unique(self.corners)]
        return float((used.max(0) - used.min(0)).max()) if len(used) else 0.0

    def area_vectors(self) -> Floats:
        """(F, B, 3) area along the normal."""
        first = self.points[np.repeat(self.corners[self.offsets[:-1]], self.sizes)]  # so that nothing cancels
        crosses = np.cross(self.points[self.corners] - first, self.points[self.heads] - first)
        areas: Floats = 0.5 * np.add.reduceat(crosses, self.offsets[:-1], axis=0)
        return areas

    def without_area(self) -> Bools:
        """(F,) whether a face has no area in any of the meshes: |A| <= 4 eps sum l^2."""
        if not len(self.faces):
            return np.zeros(0, np.bool_)
        squares = ((self.points[self.heads] - self.points[self.corners]) ** 2).sum(-1)
        limits = 4.0 * _EPSILON * np.add.reduceat(squares, self.offsets[:-1], axis=0)
        flat: Bools = (np.linalg.norm(self.area_vectors(), axis=-1) <= limits).all(-1)
        return flat

    def saying(self, *parts: Part | list[Part]) -> Soup:
        """The same, with another sentence."""
        return replace(self, said=(*self.said, sentence(*parts)))

    def keeping(self, faces: Bools) -> Soup:
        """Some of the faces."""
        corners = np.repeat(faces, self.sizes)
        offsets = np.concatenate([[0], np.cumsum(self.sizes[faces])]).astype(np.int64)
        return replace(self, corners=self.corners[corners], offsets=offsets, faces=self.faces[faces],
            origins=self.origins[corners])  # fmt: skip

    def renaming(self, names: Ints) -> Soup:
        """Vertices (V,) merged into others."""
        return replace(self, corners=names[self.corners], merged=names[self.merged])
