"""A triangle mesh that is still being cut: arrays, and where its boundary lies on curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from ....curves import ClosedCurve

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


class Patch(NamedTuple):
    """Triangles whose boundary vertices have parameters on closed curves.

    Attributes:
        points: (V, 3).
        faces: (F, 3).
        rims: (V,) number of the curve that a vertex lies on, -1 inside.
        parameters: (V,) on that curve.
        corners: (V,) whether it is a corner of the curve.
    """

    points: Floats
    faces: Ints
    rims: Ints
    parameters: Floats
    corners: Mask

    @property
    def inside(self) -> Mask:
        """(V,) vertices that lie on no curve."""
        return self.rims < 0

    def without_unused(self) -> Patch:
        """The same without vertices of no face."""
        used = np.zeros(len(self.points), bool)
        used[self.faces] = True
        numbers = np.cumsum(used) - 1
        kept = (self.points[used], numbers[self.faces], self.rims[used], self.parameters[used], self.corners[used])
        return Patch(*kept)


def rim_vertices(curves: Sequence[ClosedCurve], counts: Sequence[int]) -> Patch:
    """Evenly spaced vertices on every curve, corners among them, in the order of the curves; no faces yet."""
    parameters = [curve.spaced(count) for curve, count in zip(curves, counts, strict=True)]
    points = [curve.at(places) for curve, places in zip(curves, parameters, strict=True)]
    corners = [torch.isin(places, curve.corners) for curve, places in zip(curves, parameters, strict=True)]
    rims = np.repeat(np.arange(len(curves)), [len(places) for places in parameters])
    return Patch(
        torch.cat(points).numpy(), np.zeros((0, 3), np.int64), rims, torch.cat(parameters).numpy(),
        torch.cat(corners).numpy(),
    )  # fmt: skip


def rim_edges(counts: Sequence[int]) -> Ints:
    """(n, 2) edges of closed polygons of so many vertices, numbered one after the other."""
    edges, first = [], 0
    for count in counts:
        here = first + np.arange(count)
        edges.append(np.stack([here, np.roll(here, -1)], 1))
        first += count
    return np.concatenate(edges)


def middle_parameters(first: Floats, second: Floats) -> Floats:
    """Half way between parameters on a circle of length 1, the short way."""
    ahead = np.remainder(second - first + 0.5, 1.0) - 0.5
    middle: Floats = np.remainder(first + 0.5 * ahead, 1.0)
    return middle


class Edges(NamedTuple):
    """Edges of a triangle mesh.

    Attributes:
        ends: (E, 2) vertices, ascending.
        of_faces: (F, 3) edge of every face that lies opposite to its corner.
        boundary: (E,) whether only one face has it.
    """

    ends: Ints
    of_faces: Ints
    boundary: Mask


def edges_of(faces: Ints) -> Edges:
    """All edges of triangles (F, 3)."""
    pairs = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
    size = int(faces.max()) + 1
    keys, numbers, counts = np.unique(pairs @ np.array([size, 1]), return_inverse=True, return_counts=True)
    return Edges(np.stack(np.divmod(keys, size), 1), numbers.reshape(-1, 3), counts == 1)


def face_vectors(points: Floats, faces: Ints) -> Floats:
    """(F, 3) normals, as long as twice the area."""
    a, b, c = points[faces].transpose(1, 0, 2)
    vectors: Floats = np.cross(b - a, c - a)
    return vectors


def smallest_angles(points: Floats, faces: Ints) -> Floats:
    """(F,) the smallest angle of every face, radians."""
    p = points[faces]
    ahead, back = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    sine = np.linalg.norm(np.cross(ahead, back), axis=2)
    angles: Floats = np.arctan2(sine, (ahead * back).sum(2)).min(1)
    return angles
