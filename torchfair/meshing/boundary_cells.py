"""Cells that the boundary and creases clip, made fit for use: no short edges, no slivers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..fields.frames import Floats, Ints
from .polygon_edits import PolygonEdits
from .tracing import Cells

_SHORT = 0.3  # edges at the boundary, over the spacing
_SHORTEST = 0.2  # below that edges go even if others turn by more than they may
_SMALL = 0.08  # area of faces at the boundary, over that of full cells
_SMALLEST = 0.06  # the same over the mean of the faces, which is larger where lines diverge
_ROUNDS = 8


def tidy_boundary(cells: Cells, spacing: float | Floats, area: float | Floats, most: float = math.inf) -> PolygonEdits:
    """Collapses short edges at the boundary and at creases and joins slivers with neighbours, each change checked.

    Where a collapse would turn an inner edge too far from the line that it lies on, the short edge stays, unless it is
    very short.

    Args:
        cells: of a map.
        spacing: length of edges, also (N,) at the nodes.
        area: of full cells, also (N,).
        most: radians by which inner edges may turn; by default any angle.

    Returns:
        The polygons; positions that no face uses are among theirs.
    """
    faces = [face for face in cells.faces if len(face) > 2]  # bulges of the boundary over one line
    edits = PolygonEdits(cells.positions, faces, cells.on_boundary, cells.fixed, cells.creases)
    lengths, areas = (np.broadcast_to(np.asarray(of, np.float64), len(cells.positions)) for of in (spacing, area))
    for _ in range(_ROUNDS):
        for number in edits.curve_faces():
            edits.drop_straight_nodes(number)
        if not _collapse_short(edits, lengths, most) + _join_small(edits, areas):
            break
    return edits


def _collapse_short(edits: PolygonEdits, lengths: Floats, most: float) -> int:
    """Collapses edges at curves below a length, the shortest first."""

    def share(edge: tuple[int, int]) -> float:
        return edits.length(edge) / float(lengths[list(edge)].min())

    sides = {(min(edge), max(edge)) for number in edits.curve_faces() for edge in edits.sides(number)}
    shares = sorted((share((a, b)), (a, b)) for a, b in sides if edits.on_curve[a] or edits.on_curve[b])
    done = 0
    for before, (a, b) in shares:
        if before >= _SHORT:
            break
        if edits.around.get(a) and edits.around.get(b) and (now := share((a, b))) < _SHORT:
            done += edits.collapse((a, b), most if now >= _SHORTEST else math.inf)
    return done


def _join_small(edits: PolygonEdits, areas: Floats) -> int:
    """Joins faces at curves below an area with the neighbour across their longest side, or collapses their shortest."""
    least = max(_SMALL, _SMALLEST * float(edits.areas_over(areas).mean())) if edits.faces else _SMALL
    done = 0
    for number in sorted(edits.curve_faces(), key=edits.area):
        if number not in edits.faces or edits.area(number) >= least * areas[edits.faces[number]].min():
            continue
        sides = sorted(edits.sides(number), key=edits.length)
        inner = [edge for edge in sides if edits.across(edge, number) is not None]
        done += any(edits.collapse(edge) for edge in sides[:2]) or any(
            edits.merge(number, edge) for edge in reversed(inner)
        )
    return done


class Compact(NamedTuple):
    """Polygons without the positions that none of them uses.

    Attributes:
        positions: (V, 3).
        faces: vertices counterclockwise.
        number: (N,) vertex of every node, that of the one it was collapsed to, -1 if it is gone.
        creases: (C, 2) vertices of edges along creases, the smaller first.
    """

    positions: Floats
    faces: list[list[int]]
    number: Ints
    creases: Ints


def compact(edits: PolygonEdits) -> Compact:
    """The polygons with new numbers."""
    used = np.array(sorted({node for face in edits.faces.values() for node in face}), np.int64)
    number = np.full(len(edits.positions), -1)
    number[used] = np.arange(len(used))
    faces = [number[face].tolist() for face in edits.faces.values()]
    for node in edits.went:
        number[node] = number[edits.place_of(node)]
    pairs = {(min(a, b), max(a, b)) for a, others in edits.beside.items() for b in others}
    creases = np.sort(number[np.array(sorted(pairs), np.int64).reshape(-1, 2)], axis=1)
    return Compact(edits.positions[used], faces, number, creases)
