"""A mesh cut open, with a field of directions combed on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..fields import (
    Directions,
    FaceFrames,
    Pull,
    Symmetry,
    direction_field,
    matchings,
    merge_singularities,
    vertex_charges,
)
from ..fields.frames import Floats
from ..fields.matchings import QUARTER
from .creases import Creases, crease_pull
from .cut_graph import CutGraph, cut_open

_FIRM = 10.0  # weight of creases that the field follows


def combed(
    frames: FaceFrames,
    directions: Directions,
    symmetry: Symmetry,
    smoothing: float,
    merging: float,
    creases: Creases | None = None,
    angle: float = 0.0,
) -> CutGraph:
    """The mesh cut open, with a field of directions.

    Crosses are tried for directions, too: the larger and the smaller curvature change places where the surface has an
    umbilic line, crosses go on. They will do if one of their two directions never comes back as the other.

    Args:
        frames: of the triangles.
        directions: principal directions.
        symmetry: of the field, 2 or 4.
        smoothing: length over which directions are smoothed.
        merging: singular vertices that are closer are merged, but for corners of creases.
        creases: of the surface.
        angle: between chains of creases and the field, up to which it follows them.
    """
    stay = None if creases is None else creases.corners
    tried: tuple[Symmetry, ...] = (4, 2) if symmetry == 2 else (4,)
    for of in tried:
        angles = _field(frames, directions, smoothing, of, creases, angle)
        matched = matchings(frames, angles, of)
        angles, matched = merge_singularities(frames, angles, matched, directions, smoothing, merging, of, stay)
        graph = cut_open(frames, angles, matched, vertex_charges(frames, angles, matched))
        if symmetry == 4 or not (graph.quarters % 2).any():
            break
    if symmetry == 4:
        return graph
    along = directions.values * np.exp(-2j * graph.angles)
    across = float(frames.areas @ along.real) < 0
    return replace(graph, angles=graph.angles + QUARTER) if across else graph


def _field(
    frames: FaceFrames,
    directions: Directions,
    smoothing: float,
    symmetry: Symmetry,
    creases: Creases | None,
    angle: float,
) -> Floats:
    """The field that follows the creases which it nearly follows by itself."""
    if creases is None or not creases.chains:
        return direction_field(frames, directions, smoothing, symmetry)
    pull, chains = crease_pull(frames, creases)
    field = direction_field(frames, directions, smoothing, symmetry, pull)
    turns = np.rint((field[pull.faces] - pull.angles) / QUARTER)
    off = np.abs(field[pull.faces] - pull.angles - turns * QUARTER)
    count = np.bincount(chains)
    follows = np.bincount(chains, off) <= angle * count
    if not follows.any():
        return field
    firm = Pull(pull.faces, pull.angles + turns * QUARTER, np.where(follows[chains], _FIRM, pull.weights))
    return direction_field(frames, directions, smoothing, symmetry, firm)
