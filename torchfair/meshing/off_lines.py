"""Values at corners a hair off the lines of whole numbers, so that none passes through a vertex or along an edge."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fields.frames import FaceFrames, Floats, Ints
from .boundary_runs import BoundaryRun
from .crease_runs import CreaseLines
from .seamless_map import SeamlessMap

_MARGIN = 1e-7  # by which vertices that are not nodes stay off the lines
_INWARD = 1e-6  # by which a curve lies inside its line on either side, so that no cell is left beyond it


class Side(NamedTuple):
    """An edge on a line, seen from a triangle: its face and the corner where it starts, counterclockwise."""

    face: int
    corner: int


def boundary_sides(runs: list[BoundaryRun]) -> list[Side]:
    """Those of boundary runs."""
    return [Side(*start) for run in runs for start in run.corners[::2]]


def crease_sides(frames: FaceFrames, edges: Ints) -> list[tuple[Side, Side]]:
    """Those of sharp edges on lines: left and right."""
    faces, corners = frames.faces[edges].tolist(), frames.corners[edges].tolist()
    return [(Side(f, i), Side(g, j)) for (f, g), (i, j) in zip(faces, corners, strict=True)]


def off_the_lines(
    found: SeamlessMap, runs: list[BoundaryRun] | None = None, lines: CreaseLines | None = None
) -> np.ndarray:
    """(F, 3) complex values at corners, those of vertices that are not nodes moved off whole numbers.

    Vertices of boundary runs move into the surface. So do those of creases on lines, on both sides: no line passes
    beside them, and the crease stands for it. Everywhere else corners of a vertex move alike.

    Args:
        found: the map.
        runs: boundary edges on lines.
        lines: creases on lines.
    """
    frames, seams = found.frames, found.seams
    edges = np.zeros(0, np.int64) if lines is None else lines.on_lines
    cut = np.zeros(len(frames.faces), bool)
    cut[edges] = True
    sectors = frames.joined_corners(cut)
    vertex = np.zeros(int(sectors.max()) + 1, np.int64)
    vertex[sectors] = frames.triangles
    move: np.ndarray = np.zeros(len(vertex), complex)
    pairs = crease_sides(frames, edges)
    for side in [*boundary_sides(runs or []), *(side for pair in pairs for side in pair)]:
        _move_inward(found, move, sectors, side)
    for pair in pairs:
        _move_along_alike(found, move, sectors, pair)
    is_own = np.ones(len(seams.vertex), bool)
    is_own[list(seams.terms)] = [not seams.terms[c] and seams.unit[c] == 1 for c in seams.terms]
    value: np.ndarray = np.zeros(len(frames.points), complex)
    value[seams.vertex[is_own]] = found.values[is_own]
    _keep_a_margin(value[vertex], move)
    move[found.graph.nodes[vertex]] = 0
    return np.asarray(found.values[seams.copies] + seams.unit[seams.copies] * move[sectors])


def _axis(found: SeamlessMap, side: Side) -> complex:
    """Across the edge: 1 if the first coordinate is constant on it, i if the second."""
    values = found.values[found.seams.copies[side.face]]
    along = values[(side.corner + 1) % 3] - values[side.corner]
    return 1.0 if abs(along.real) < abs(along.imag) else 1j


def _move_inward(found: SeamlessMap, move: np.ndarray, sectors: Ints, side: Side) -> None:
    copies, axis = found.seams.copies[side.face], _axis(found, side)
    inside = found.values[copies[(side.corner + 2) % 3]] - found.values[copies[side.corner]]
    for corner in (side.corner, (side.corner + 1) % 3):
        inward = _INWARD * np.sign((inside / axis).real) * axis * found.seams.unit[copies[corner]].conjugate()
        for unit in (1.0, 1j):
            if part := (inward / unit).real:
                at = sectors[side.face, corner]
                move[at] += part * unit - (move[at] / unit).real * unit


def _move_along_alike(found: SeamlessMap, move: np.ndarray, sectors: Ints, pair: tuple[Side, Side]) -> None:
    """Where a crease meets the boundary one of its sides may have moved along it: the other does so, too."""
    left, right = pair
    for k in (0, 1):
        ours, theirs = sectors[left.face, (left.corner + k) % 3], sectors[right.face, (right.corner + 1 - k) % 3]
        copy = found.seams.copies[left.face, (left.corner + k) % 3]
        unit = 1j * _axis(found, left) * found.seams.unit[copy].conjugate()
        along = [(move[at] / unit).real for at in (ours, theirs)]
        for at, here, there in ((ours, *along), (theirs, *along[::-1])):
            if not here:
                move[at] += there * unit


def _keep_a_margin(value: np.ndarray, move: np.ndarray) -> None:
    for part, moved, factor in ((value.real, move.real, 1.0), (value.imag, move.imag, 1j)):
        to_line: Floats = part - np.rint(part)
        close = (np.abs(to_line) < _MARGIN) & (moved == 0)
        move[close] += factor * (np.where(to_line[close] < 0, -_MARGIN, _MARGIN) - to_line[close])
