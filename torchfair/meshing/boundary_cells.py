"""Cells that the boundary clips, made fit for use: no short edges, no slivers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fields.frames import Floats, Ints
from .polygon_edits import PolygonEdits
from .tracing import Cells

_SHORT = 0.3  # edges at the boundary, over the spacing
_SMALL = 0.08  # area of faces at the boundary, over that of full cells
_ROUNDS = 8


def tidy_boundary(cells: Cells, spacing: float, area: float) -> PolygonEdits:
    """Collapses short edges at the boundary and joins slivers with their neighbours, each change checked.

    Args:
        cells: of a map.
        spacing: length of edges.
        area: of full cells.

    Returns:
        The polygons; positions that no face uses are among theirs.
    """
    faces = [face for face in cells.faces if len(face) > 2]  # bulges of the boundary over one line
    edits = PolygonEdits(cells.positions.copy(), faces, cells.on_boundary.copy(), cells.is_corner | cells.singular)
    for _ in range(_ROUNDS):
        for number in edits.boundary_faces():
            edits.drop_straight_nodes(number)
        if not _collapse_short(edits, _SHORT * spacing) + _join_small(edits, _SMALL * area):
            break
    return edits


def _collapse_short(edits: PolygonEdits, limit: float) -> int:
    """Collapses edges at the boundary below a length, the shortest first."""
    sides = {(min(edge), max(edge)) for number in edits.boundary_faces() for edge in edits.sides(number)}
    lengths = sorted((edits.length((a, b)), (a, b)) for a, b in sides if edits.on_boundary[a] or edits.on_boundary[b])
    done = 0
    for length, (a, b) in lengths:
        if length >= limit:
            break
        if edits.around.get(a) and edits.around.get(b) and edits.length((a, b)) < limit:
            done += edits.collapse((a, b))
    return done


def _join_small(edits: PolygonEdits, limit: float) -> int:
    """Joins faces below an area with the neighbour across their longest side, or collapses their shortest."""
    done = 0
    for number in sorted(edits.boundary_faces(), key=edits.area):
        if number not in edits.faces or edits.area(number) >= limit:
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
    """

    positions: Floats
    faces: list[list[int]]
    number: Ints


def compact(edits: PolygonEdits) -> Compact:
    """The polygons with new numbers."""
    used = np.array(sorted({node for face in edits.faces.values() for node in face}), np.int64)
    number = np.full(len(edits.positions), -1)
    number[used] = np.arange(len(used))
    faces = [number[face].tolist() for face in edits.faces.values()]
    for node in edits.went:
        number[node] = number[edits.place_of(node)]
    return Compact(edits.positions[used], faces, number)
