"""By how many quarter turns directions of neighbouring triangles differ, and what that says of vertices."""

from __future__ import annotations

import numpy as np
import torch

from ..geometry import angle_defects
from .direction_field import Symmetry
from .frames import FaceFrames, Floats, Ints

QUARTER = np.pi / 2


def matchings(frames: FaceFrames, angles: Floats, symmetry: Symmetry = 4) -> Ints:
    """(I,) quarter turns from the direction of the left face, brought over the edge, to that of the right face.

    They are rounded to the nearest multiple that the symmetry allows: half turns, so even numbers, for 2.

    Args:
        frames: of the triangles.
        angles: (F,) of the field in the frames.
        symmetry: 2 or 4.
    """
    step = 4 // symmetry
    return step * np.rint(differences(frames, angles) / (step * QUARTER)).astype(np.int64)


def differences(frames: FaceFrames, angles: Floats) -> Floats:
    """(I,) angle from the direction of the left face, brought over the edge, to that of the right face."""
    f, g = frames.faces.T
    return np.asarray(angles[g] - angles[f] - frames.turns)


def vertex_charges(frames: FaceFrames, angles: Floats, matched: Ints) -> Ints:
    """(V,) four times the index of the field at every vertex; 0 at boundary vertices.

    The index is the number of turns that directions make around a vertex: a quarter where three quads meet, minus a
    quarter where five do.

    Args:
        frames: of the triangles.
        angles: (F,) of the field in the frames.
        matched: (I,) quarter turns over edges.
    """
    charges = np.rint(4 * _turns(frames, angles, matched)).astype(np.int64)
    return np.where(frames.is_boundary, 0, charges)


def loop_charges(frames: FaceFrames, angles: Floats, matched: Ints) -> Floats:
    """Four times the turns of the field against the tangent along every boundary loop, whole numbers.

    Together with the charges of vertices they sum to four times the Euler number.
    """
    turns, topology = _turns(frames, angles, matched), frames.topology
    return np.array([4 * turns[loop.numpy()].sum() for loop in topology.boundary_loops()])


def _turns(frames: FaceFrames, angles: Floats, matched: Ints) -> Floats:
    """(V,) turns around every vertex: its angle defect plus what the field turns over the edges around it."""
    turning = differences(frames, angles) - QUARTER * matched
    # Counterclockwise around its start an edge is crossed from the right to the left.
    size = len(frames.points)
    start, end = frames.edges.T
    around = np.bincount(end, turning, size) - np.bincount(start, turning, size)
    defects = angle_defects(torch.from_numpy(frames.points), frames.topology).numpy()
    return np.asarray((defects + around) / (2 * np.pi))
