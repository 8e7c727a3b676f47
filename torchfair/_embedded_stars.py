"""Stars of triangles that certainly do not run through themselves, told without looking at pairs."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_ONCE, _LESS_THAN_ONCE = 3.0 * np.pi, 2.0 * np.pi - 1e-6


def embedded_stars(points: Floats, triangles: Ints, is_open: Mask, margin: float) -> Mask:
    """(V,) whether the triangles around a vertex, one fan of them, surely have no other point than it in common.

    Seen along the sum of their area vectors they all turn the same way, by more than rounding, and run around the
    vertex once at most. False says nothing: the star may be embedded nevertheless.

    Args:
        points: (V, 3).
        triangles: (T, 3) all of them, those without area, too.
        is_open: (V,) whether the fan of a vertex has two ends.
        margin: Length that is far above what rounding makes of coordinates.
    """
    count = len(points)
    corners = [np.ascontiguousarray(column) for column in triangles.T]
    at = [[np.ascontiguousarray(axis)[corner] for axis in points.T] for corner in corners]  # corner, axis
    sides = [[at[(i + 1) % 3][axis] - at[i][axis] for axis in range(3)] for i in range(3)]
    x, y = sides[0], sides[1]
    area = [x[i] * y[j] - x[j] * y[i] for i, j in ((1, 2), (2, 0), (0, 1))]
    normals = [_sums(corners, axis, count) for axis in area]
    length = np.sqrt(_dot(normals, normals))
    normals = [axis / np.where(length > 0.0, length, 1.0) for axis in normals]
    longest = np.sqrt(np.maximum(np.maximum(_dot(x, x), _dot(y, y)), _dot(sides[2], sides[2])))
    safe, turns = length > 0.0, np.zeros(count)
    for i, corner in enumerate(corners):
        normal = [axis[corner] for axis in normals]
        doubled = _dot(normal, area)
        safe[corner[~(doubled > margin * longest)]] = False
        ahead, behind = sides[i], sides[i - 1]  # the second one comes back to the vertex
        along = _dot(ahead, normal) * _dot(behind, normal) - _dot(ahead, behind)
        turns += _sums([corner], np.arctan2(doubled, along), count)
    embedded: Mask = safe & (turns < np.where(is_open, _LESS_THAN_ONCE, _ONCE))
    return embedded


def _sums(corners: list[Ints], values: Floats, count: int) -> Floats:
    """(V,) sum of the values (T,) of the triangles that have a vertex as one of these corners."""
    total = np.zeros(count)
    for corner in corners:
        total += np.bincount(corner, values, count)
    return total


def _dot(a: list[Floats], b: list[Floats]) -> Floats:
    product: Floats = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product
