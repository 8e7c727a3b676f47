"""Cells of a triangle lattice, cut into triangles."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Floats
from .polygon_area import area_vector

Pair = tuple[int, int]


def cut_cells(positions: Floats, faces: list[list[int]], rows: set[Pair]) -> list[list[int]]:
    """Triangles of cells: whole ones are cut along the diagonal that leads forward.

    Clipped ones are cut so that no angle is smaller than it has to be. A whole cell has two opposite sides on rows.
    Seen along a row, counterclockwise, its diagonal starts where a side on a row starts, whichever of the two: half a
    turn brings the lattice to itself.

    Args:
        positions: (V, 3).
        faces: of cells.
        rows: edges on rows, the smaller vertex first.
    """
    triangles: list[list[int]] = []
    for face in faces:
        on_row = [_pair(face[k], face[(k + 1) % len(face)]) in rows for k in range(len(face))]
        if len(face) == 4 and on_row in ([True, False, True, False], [False, True, False, True]):
            a, b, c, d = face[on_row.index(True) :] + face[: on_row.index(True)]
            triangles += [[a, b, c], [a, c, d]]
        else:
            triangles += _best_cut(positions, face)
    return triangles


def _pair(a: int, b: int) -> Pair:
    return (a, b) if a < b else (b, a)


def _best_cut(positions: Floats, face: list[int]) -> list[list[int]]:
    """Triangles of a polygon by diagonals such that the smallest of their angles is as large as it can be."""
    normal = area_vector(positions, face)
    best: dict[tuple[int, int], tuple[float, list[list[int]]]] = {(k, k + 1): (np.inf, []) for k in range(len(face))}
    for width in range(2, len(face)):
        for first in range(len(face) - width):
            last = first + width
            tried = []
            for middle in range(first + 1, last):
                triangle = [face[first], face[middle], face[last]]
                (before, left), (after, right) = best[first, middle], best[middle, last]
                angle = _smallest_angle(positions, triangle, normal)
                tried.append((min(before, after, angle), [*left, triangle, *right]))
            best[first, last] = max(tried, key=lambda rated: rated[0])
    return best[0, len(face) - 1][1]


def _smallest_angle(positions: Floats, triangle: list[int], normal: Floats) -> float:
    """In radians, negative where the triangle is turned over."""
    corners = positions[triangle]
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    area = area_vector(positions, triangle)
    doubled = 2 * np.linalg.norm(area)
    products = np.sort(lengths * np.roll(lengths, 1))
    angle = float(np.arcsin(min(doubled / products[-1], 1.0))) if products[-1] > 0 else 0.0
    return angle if area @ normal > 0 else angle - np.pi
