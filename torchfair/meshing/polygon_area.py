"""Area vectors of polygons: their normals, as long as their areas, as exact far from the origin as near it."""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain

import numpy as np

from ..fields.frames import Floats, Ints


def area_vector(positions: Floats, face: list[int]) -> Floats:
    """Of one polygon.

    Args:
        positions: (V, 3).
        face: vertices counterclockwise.
    """
    apart = positions[face] - positions[face[0]]
    (x, y, z), (a, b, c) = apart[:-1].T, apart[1:].T  # the first is zero, and so is what it adds at the end
    return np.array([y @ c - z @ b, z @ a - x @ c, x @ b - y @ a]) / 2


def area_vectors(positions: Floats, faces: Collection[list[int]]) -> Floats:
    """(F, 3) of many polygons; see :func:`area_vector`."""
    nodes, starts = joined(faces)
    sizes = np.diff(starts, append=len(nodes))
    apart = positions[nodes] - np.repeat(positions[nodes[starts]], sizes, axis=0)
    following = np.vstack([apart[1:], np.zeros((1, 3))])  # of the last of a face zero, as is its first
    return np.asarray(np.add.reduceat(np.cross(apart, following), starts)) / 2 if len(nodes) else np.zeros((0, 3))


def joined(faces: Collection[list[int]]) -> tuple[Ints, Ints]:
    """Vertices of some polygons, one after the other, and (F,) where each begins."""
    sizes = np.fromiter(map(len, faces), np.int64, len(faces))
    return np.fromiter(chain.from_iterable(faces), np.int64, int(sizes.sum())), np.cumsum(sizes) - sizes
