"""Thin triangles at the boundary and at creases, where clipped cells are cut, shared out by flips of edges."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Bools, Floats
from .boundary_cells import Compact, compact
from .polygon_area import area_vector, area_vectors
from .polygon_edits import PolygonEdits
from .tracing import Cells

Pair = tuple[int, int]

_SMALL = 0.06  # area over the mean
_ROUNDS = 4


def without_thin_triangles(cells: Cells, whole: Compact) -> Compact:
    """Triangles that cells were cut into; those at curves are no thinner than a few edits of their edges can make them.

    An edge of a triangle below 6 % of the mean area is flipped where that leaves the smaller one of the two triangles
    beside it larger and turns neither over. Where no flip helps, its shortest edge is collapsed, if its ends may.
    Edges on rows and along creases are not flipped; corners stay.

    Args:
        cells: of a map.
        whole: the triangles.
    """
    for _ in range(_ROUNDS):
        on_boundary, fixed = (_marked(whole, marks) for marks in (cells.on_boundary, cells.fixed))
        on_curve = on_boundary.copy()
        on_curve[whole.creases] = True
        if not _small(whole.positions, whole.faces, on_curve):
            break
        whole = whole._replace(faces=_flipped(whole, rows_of(cells, whole), on_curve))
        edits = PolygonEdits(whole.positions, whole.faces, on_boundary, fixed, whole.creases)
        if not _collapsed(edits, _small(whole.positions, whole.faces, on_curve)):
            break
        fewer = compact(edits)
        whole = fewer._replace(number=np.where(whole.number >= 0, fewer.number[whole.number], -1))
    return whole


def rows_of(cells: Cells, whole: Compact) -> set[Pair]:
    """Pairs of vertices that are ends of an edge on a line with the second coordinate constant."""
    pairs = [
        (face[side], face[(side + 1) % len(face)])
        for face, on in zip(cells.faces, cells.coordinates, strict=True)
        for side in range(len(face))
        if on[side] == 1
    ]
    numbered = np.sort(whole.number[np.array(pairs, np.int64).reshape(-1, 2)], axis=1)
    return {(int(a), int(b)) for a, b in numbered if 0 <= a < b}


def _marked(whole: Compact, marks: Bools) -> Bools:
    """(V,) bool: vertices at which some node of the cells (N,) is marked."""
    marked = np.zeros(len(whole.positions), bool)
    marked[whole.number[marks & (whole.number >= 0)]] = True
    return marked


def _small(positions: Floats, triangles: list[list[int]], on_curve: Bools) -> list[int]:
    """Numbers of small triangles with a vertex on a curve, the smallest first."""
    areas = np.linalg.norm(area_vectors(positions, triangles), axis=1)
    small = np.flatnonzero((areas < _SMALL * areas.mean()) & on_curve[np.array(triangles)].any(1))
    found: list[int] = small[np.argsort(areas[small], kind="stable")].tolist()
    return found


def _collapsed(edits: PolygonEdits, small: list[int]) -> int:
    """How many of some triangles lost one of their two shorter sides; others that this changes wait."""
    before, done = {number: list(edits.faces[number]) for number in small}, 0
    for number in small:
        if edits.faces.get(number) == before[number]:
            done += any(edits.collapse(edge) for edge in sorted(edits.sides(number), key=edits.length)[:2])
    return done


def _flipped(whole: Compact, rows: set[Pair], on_curve: Bools) -> list[list[int]]:
    """The triangles after flips beside small ones."""
    found = [list(triangle) for triangle in whole.faces]
    owners = {(face[k - 1], face[k]): number for number, face in enumerate(found) for k in range(3)}
    kept = rows | {(int(a), int(b)) for a, b in whole.creases}
    for _ in range(_ROUNDS):
        small = _small(whole.positions, found, on_curve)
        if not sum(_flip_one(whole.positions, found, owners, kept, number) for number in small):
            break
    return found


def _flip_one(
    positions: Floats, triangles: list[list[int]], owners: dict[Pair, int], kept: set[Pair], number: int
) -> bool:
    """Flips the edge of a triangle that leaves the smaller of two triangles largest, if it is larger than before."""
    best: tuple[float, int, list[list[int]]] | None = None
    for k in range(3):
        a, b, c = triangles[number][k:] + triangles[number][:k]
        other = owners.get((c, b))
        if other is None or (min(b, c), max(b, c)) in kept:
            continue
        (d,) = set(triangles[other]) - {b, c}
        if (a, d) in owners or (d, a) in owners:
            continue
        before = [area_vector(positions, triangles[of]) for of in (number, other)]
        new = [[a, b, d], [a, d, c]]
        normal = before[0] + before[1]
        size = max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
        least = min(float(area_vector(positions, face) @ normal) / size for face in new)
        if least > max(min(float(np.linalg.norm(area)) for area in before), best[0] if best else 0.0):
            best = least, other, new
    if best is None:
        return False
    _, other, new = best
    for old in (number, other):
        for k in range(3):
            del owners[triangles[old][k - 1], triangles[old][k]]
    for old, face in zip((number, other), new, strict=True):
        triangles[old] = face
        for k in range(3):
            owners[face[k - 1], face[k]] = old
    return True
