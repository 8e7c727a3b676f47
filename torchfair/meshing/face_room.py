"""Whether faces keep angles, sides and areas as their corners move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fields.frames import Bools, Floats, Ints
from ..topology import Topology

_STRAIGHT = np.radians(185.0)  # angles may rise to that
_SHORT = 0.3  # spacings: sides may shrink to that, shorter ones by a tenth
_SHRUNK = 0.9
_SMALL = 0.1  # squared spacings: areas may fall to that
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class FaceRoom:
    """What faces have to keep, by their corners in order, face after face.

    What is worse than the bounds at first may stay as it is.

    Attributes:
        corners: (C,) vertices.
        face, ahead, back: (C,) number of the face, the next corner and the one before.
        normals: (F, 3) unit vectors.
        angles: (2, C) smallest and largest, radians.
        lengths: (C,) least, of the sides that start at corners.
        areas: (F,) least.
    """

    corners: Ints
    face: Ints
    ahead: Ints
    back: Ints
    normals: Floats
    angles: Floats
    lengths: Floats
    areas: Floats

    @classmethod
    def of(cls, topology: Topology, points: Floats, spacing: float, acute: float) -> FaceRoom:
        """What the faces of a mesh with vertices (V, 3) have to keep; angles may fall to ``acute``, radians."""
        sizes = topology.face_sizes.numpy()
        starts = np.cumsum(sizes) - sizes
        face = np.repeat(np.arange(len(sizes)), sizes)
        rank, first, size = np.arange(len(face)) - starts[face], starts[face], sizes[face]
        ahead, back = first + (rank + 1) % size, first + (rank - 1) % size
        zero = np.zeros(0)
        room = cls(topology.corners.numpy(), face, ahead, back, np.zeros((len(sizes), 3)), zero, zero, zero)
        normals = room._area_vectors(points)
        sides = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        room = cls(room.corners, face, ahead, back, normals / sides, zero, zero, zero)
        angles, lengths, areas = room._measured(points)
        return cls(
            room.corners,
            face,
            ahead,
            back,
            room.normals,
            np.stack([np.minimum(angles, acute) - _ROUNDING, np.maximum(angles, _STRAIGHT) + _ROUNDING]),
            _SHRUNK * np.minimum(lengths, _SHORT * spacing),
            np.minimum(areas, _SMALL * spacing**2) * (1 - _ROUNDING),
        )

    def tight(self, points: Floats) -> Bools:
        """(V,) the corners of faces that would have too little room with vertices at points (V, 3)."""
        angles, lengths, areas = self._measured(points)
        wrong = (angles < self.angles[0]) | (angles > self.angles[1]) | (lengths < self.lengths)
        faces = areas < self.areas
        faces[self.face[wrong]] = True
        found = np.zeros(len(points), bool)
        found[self.corners[faces[self.face]]] = True
        return found

    def _measured(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Angles (C,) from 0 to 2 pi, lengths (C,), areas (F,), seen along the normals."""
        at = points[self.corners]
        out, back = at[self.ahead] - at, at[self.back] - at
        sines = (np.cross(out, back) * self.normals[self.face]).sum(1)
        angles = np.arctan2(sines, (out * back).sum(1)) % (2 * np.pi)
        return angles, np.linalg.norm(out, axis=1), (self._area_vectors(points) * self.normals).sum(1)

    def _area_vectors(self, points: Floats) -> Floats:
        at = points[self.corners]
        first = at[np.searchsorted(self.face, self.face)]
        doubled = np.cross(at - first, at[self.ahead] - first)
        return np.stack([np.bincount(self.face, doubled[:, k], len(self.normals)) / 2 for k in range(3)], axis=1)
