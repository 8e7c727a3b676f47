"""Where lines of whole numbers cross the edges of the triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._ranges import ranges
from ..fields.frames import Bools, Floats, Ints
from .seamless_map import SeamlessMap
from .seams import ROTATIONS


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings of lines with edges, sorted along every edge; all decisions are made once, on its left side.

    Lines are named by the coordinate that is constant on them, 0 or 1, and its whole value.

    Attributes:
        edge: (X,) edge of every crossing, in the numbering of the topology, boundary edges included.
        along: (X,) from 0 to 1 along the edge.
        offsets: (E+1,) first crossing of every edge.
        coordinate, level: (X, 2) the line, seen from the left and from the right face.
        values: (F, 3) complex coordinates of corners.
    """

    edge: Ints
    along: Floats
    offsets: Ints
    coordinate: Ints
    level: Ints
    values: np.ndarray


def find_crossings(found: SeamlessMap, at_corners: np.ndarray) -> Crossings:
    """The crossings of a seamless map, for values (F, 3) at corners off the lines."""
    frames = found.frames
    face, corner = frames.left_corners
    start, end = at_corners[face, corner], at_corners[face, (corner + 1) % 3]
    parts = [_levels(getattr(start, part), getattr(end, part)) for part in ("real", "imag")]
    edge, level, along = (np.concatenate([part[k] for part in parts]) for k in range(3))
    coordinate = np.repeat([0, 1], [len(part[0]) for part in parts])
    order = np.lexsort((coordinate, along, edge))
    edge, level, along, coordinate = edge[order], level[order], along[order], coordinate[order]
    offsets = np.searchsorted(edge, np.arange(frames.topology.num_edges + 1))
    other = _seen_from_right(found, edge, coordinate, level)
    return Crossings(
        edge, along, offsets, np.stack([coordinate, other[0]], 1), np.stack([level, other[1]], 1), at_corners
    )


def _levels(start: Floats, end: Floats) -> tuple[Ints, Ints, Floats]:
    """Whole numbers strictly between values at starts and ends: edges, numbers, places along the edge."""
    low, high = np.minimum(start, end), np.maximum(start, end)
    first = np.floor(low).astype(np.int64) + 1
    counts = np.maximum(np.ceil(high).astype(np.int64) - first, 0)
    edge = np.repeat(np.arange(len(start)), counts)
    level = ranges(first, counts)
    return edge, level, (level - start[edge]) / (end - start)[edge]


def _seen_from_right(found: SeamlessMap, edge: Ints, coordinate: Ints, level: Ints) -> tuple[Ints, Ints]:
    """The lines in the coordinates of the right face; arbitrary on the boundary."""
    inner = edge < len(found.frames.faces)
    which = np.where(inner, edge, 0)
    turn = (
        np.array(ROTATIONS)[found.graph.quarters[which]] if len(found.graph.quarters) else np.ones(len(edge), complex)
    )
    step = found.translations[which] if len(found.graph.quarters) else np.zeros(len(edge), complex)
    moved = turn * np.where(coordinate == 0, 1, 1j)  # the axis that is constant, turned
    swaps = np.abs(moved.real) < 0.5
    sign = np.where(swaps, moved.imag, moved.real)
    shift = np.where(swaps, step.imag, step.real)
    return np.where(swaps, 1, 0), np.rint(sign * level + shift).astype(np.int64)


def sorted_groups(*keys: Ints) -> tuple[Ints, Bools]:
    """An order by keys, the first counting most, and where in it a new combination starts."""
    order = np.lexsort(keys[::-1])
    starts = np.ones(len(order), bool)
    if len(order):
        starts[1:] = np.any([key[order][1:] != key[order][:-1] for key in keys], axis=0)
    return order, starts
