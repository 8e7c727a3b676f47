"""Singular vertices are moved to where a map has room for them."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp

from ..fields import Directions, FaceFrames, Symmetry, vertex_charges
from ..fields.frames import Bools, Floats, Ints
from ..fields.merging import carried_charges, inner_edges, nearest_paths, refitted

Step = tuple[int, int, int]
"""Vertices from and to which a charge goes along an edge, and the charge."""


def with_room(
    frames: FaceFrames,
    angles: Floats,
    matched: Ints,
    directions: Directions,
    smoothing: float,
    radius: float,
    symmetry: Symmetry = 4,
    corners: Bools | None = None,
) -> tuple[Floats, Ints]:
    """A field whose singular vertices a map can give whole numbers without turning triangles over.

    A vertex that has an index of the other sign than a corner of creases within a radius moves onto that corner:
    two points so near each other would be rounded to one. One around which a map has to cover more than a quarter turn
    by each triangle in the mean, as five quarters by four triangles, moves to the neighbour with more triangles where
    directions are trusted least.

    Args:
        frames: of the triangles.
        angles: (F,) of the field.
        matched: (I,) quarter turns over edges.
        directions: principal directions.
        smoothing: as for the field.
        radius: along edges; 0 to leave everything as it is.
        symmetry: of the field, 2 or 4.
        corners: (V,) bool: of creases; they stay. None by default.

    Returns:
        Angles (F,) and matchings (I,); those given, where nothing is to be moved.
    """
    stay = np.zeros(len(frames.points), bool) if corners is None else corners
    touched = np.zeros(len(frames.points), bool)
    graph, moved = inner_edges(frames), matched
    for find in (_onto_corners, _off_few_triangles):
        charges = vertex_charges(frames, angles, moved)
        steps = find(frames, graph, charges, stay, radius, frames.at_vertices(directions.confidence))
        moved = carried_charges(frames, moved, steps)
        touched[[vertex for step in steps for vertex in step[:2]]] = True
    if not touched.any():
        return angles, matched
    return refitted(frames, angles, moved, directions, smoothing, touched, symmetry), moved


def _onto_corners(
    frames: FaceFrames, graph: sp.csr_matrix, charges: Ints, stay: Bools, radius: float, trust: Floats
) -> list[Step]:
    """Charges that go onto corners of the other sign, the nearest first."""
    corners, others = np.flatnonzero(stay & (charges != 0)), np.flatnonzero(~stay & (charges != 0))
    opposite = np.outer(charges[corners], charges[others]) < 0
    paths = nearest_paths(graph, corners, others, radius, opposite)
    return [(a, b, int(charges[path[0]])) for path in paths for a, b in itertools.pairwise(path)]


def _off_few_triangles(
    frames: FaceFrames, graph: sp.csr_matrix, charges: Ints, stay: Bools, radius: float, trust: Floats
) -> list[Step]:
    """Charges that go to neighbours with more triangles."""
    triangles = frames.topology.valences.numpy()
    quarters = 4 - charges
    steps: list[Step] = []
    for vertex in np.flatnonzero((charges < 0) & (triangles < quarters) & ~stay).tolist():
        around, lengths = graph[vertex].indices, graph[vertex].data
        fits = (charges[around] == 0) & ~stay[around] & (triangles[around] > triangles[vertex]) & (lengths <= radius)
        if fits.any():
            beside = np.sort(around[fits])
            enough = np.minimum(triangles[beside], quarters[vertex])
            goal = int(beside[np.lexsort((trust[beside], -enough))[0]])
            steps.append((vertex, goal, int(charges[vertex])))
            charges = charges.copy()
            charges[goal], charges[vertex] = charges[vertex], 0
    return steps
