"""The faces between the lines of a map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fields.frames import Bools, Floats, Ints
from .chords import BrokenLinesError, find_chords, find_lattice_points
from .crease_runs import CreaseLines
from .crossings import find_crossings
from .line_graph import LineGraph, build_line_graph
from .seamless_map import SeamlessMap


@dataclass(frozen=True, eq=False)
class Cells:
    """Polygons between lines, full ones and those that the boundary clips.

    Attributes:
        positions: (N, 3); nodes that no polygon uses are among them.
        faces: nodes of every polygon, counterclockwise.
        coordinates: for every side of a polygon the coordinate that is constant on it, 2 on the boundary, 3 on creases
            that are no lines.
        on_boundary: (N,) bool.
        fixed: (N,) bool: nodes that stay.
        creases: (C, 2) nodes of the edges along creases.
    """

    positions: Floats
    faces: list[list[int]]
    coordinates: list[list[int]]
    on_boundary: Bools
    fixed: Bools
    creases: Ints


def trace_cells(found: SeamlessMap, values: np.ndarray, corners: Bools, lines: CreaseLines) -> Cells:
    """The cells of a seamless map, as faces of the graph that its lines, creases and the boundary make on the surface.

    Which lines meet in a triangle follows from the order of their ends on its border alone, and that order is decided
    once for every edge. So the graph is one on the surface whatever rounding does; its cells are those of a mesh of the
    same topology, if every one of them is a disk.

    Args:
        found: the map.
        values: (F, 3) at corners, off the lines.
        corners: (V,) vertices on the boundary and on creases that stay, without points of the lattice.
        lines: creases.

    Raises:
        BrokenLinesError: if lines do not fit together.
    """
    crossings = find_crossings(found, values)
    chords = find_chords(found, crossings, lines.creases.edges)
    points = find_lattice_points(chords, len(found.frames.triangles))
    graph = build_line_graph(found, crossings, chords, points, corners, lines)
    faces, coordinates = _faces(graph)
    fixed = graph.is_corner | graph.at_vertex
    return Cells(graph.positions, faces, coordinates, graph.on_boundary, fixed, graph.creases)


def _faces(graph: LineGraph) -> tuple[list[list[int]], list[list[int]]]:
    """Orbits of darts: along a dart, then sharp left."""
    following = graph.previous[graph.twin].tolist()
    origin, coordinate, outer = graph.origin.tolist(), graph.coordinate.tolist(), graph.outer.tolist()
    seen = [False] * len(following)
    faces, coordinates = [], []
    for start in range(len(following)):
        if seen[start]:
            continue
        orbit, dart = [], start
        while not seen[dart]:
            seen[dart] = True
            orbit.append(dart)
            dart = following[dart]
        outside = sum(outer[dart] for dart in orbit)
        if outside == len(orbit):
            continue
        if outside:
            raise BrokenLinesError("cells lie on both sides of the boundary")
        faces.append([origin[dart] for dart in orbit])
        coordinates.append([coordinate[dart] for dart in orbit])
    return faces, coordinates
