"""Cells of a triangle lattice, cut into triangles."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Floats
from .polygon_area import area_vector

Pair = tuple[int, int]


def cut_cells(positions: Floats, faces: list[list[int]], rows: set[Pair]) -> list[list[int]]:
    """Triangles of cells: whole ones are cut along the diagonal that leads forward, clipped ones by ears.

    A whole cell has two opposite sides on rows. Seen along a row, counterclockwise, its diagonal starts where a side on
    a row starts, whichever of the two: half a turn brings the lattice to itself.

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
            triangles += _ears(positions, list(face))
    return triangles


def _pair(a: int, b: int) -> Pair:
    return (a, b) if a < b else (b, a)


def _ears(positions: Floats, face: list[int]) -> list[list[int]]:
    """Cuts off the corner with the shortest diagonal that turns no triangle over, again and again."""
    triangles = []
    normal = area_vector(positions, face)
    while len(face) > 3:
        ears = [(_ear_cost(positions, face, k, normal), k) for k in range(len(face))]
        corner = min(ears)[1]
        triangles.append([face[corner - 1], face[corner], face[(corner + 1) % len(face)]])
        face = face[:corner] + face[corner + 1 :]
    return [*triangles, face]


def _ear_cost(positions: Floats, face: list[int], corner: int, normal: Floats) -> tuple[bool, float]:
    """Whether cutting off a corner turns it or the rest over, and the length of the cut."""
    before, after = face[corner - 1], face[(corner + 1) % len(face)]
    rest = face[:corner] + face[corner + 1 :]
    areas = [area_vector(positions, part) @ normal for part in ([before, face[corner], after], rest)]
    return bool(min(areas) <= 0), float(np.linalg.norm(positions[before] - positions[after]))
