"""A mesh cut open, with a field of directions combed on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..fields import Directions, FaceFrames, Symmetry, direction_field, matchings, merge_singularities, vertex_charges
from ..fields.matchings import QUARTER
from .cut_graph import CutGraph, cut_open


def combed(
    frames: FaceFrames, directions: Directions, symmetry: Symmetry, smoothing: float, merging: float
) -> CutGraph:
    """The mesh cut open, with a field of directions.

    Crosses are tried for directions, too: the larger and the smaller curvature change places where the surface has an
    umbilic line, crosses go on. They will do if one of their two directions never comes back as the other.

    Args:
        frames: of the triangles.
        directions: principal directions.
        symmetry: of the field, 2 or 4.
        smoothing: length over which directions are smoothed.
        merging: singular vertices that are closer are merged.
    """
    tried: tuple[Symmetry, ...] = (4, 2) if symmetry == 2 else (4,)
    for of in tried:
        angles = direction_field(frames, directions, smoothing, of)
        matched = matchings(frames, angles, of)
        angles, matched = merge_singularities(frames, angles, matched, directions, smoothing, merging, of)
        graph = cut_open(frames, angles, matched, vertex_charges(frames, angles, matched))
        if symmetry == 4 or not (graph.quarters % 2).any():
            break
    if symmetry == 4:
        return graph
    along = directions.values * np.exp(-2j * graph.angles)
    across = float(frames.areas @ along.real) < 0
    return replace(graph, angles=graph.angles + QUARTER) if across else graph
