"""Distances of points to segments of several curves, each point to the segments of its own curve."""

from __future__ import annotations

import numpy as np

from ._closest_boxes import BoxTree, Floats, Ints
from ._closest_triangles import TINY, dot

APART = 1e90  # farther apart than any two points in space, and its square is in range


class Segments:
    """Segments in space with a fourth coordinate, ``APART`` times the number of the curve they belong to.

    A point with the fourth coordinate of its own curve is nearer to every segment of that curve than to any
    box with segments of another one, so the tree serves all curves at once. Distances are measured in space.

    Args:
        starts, ends: (3, T), T > 0.
        curves: (T,) ascending; no curve without a segment.
    """

    def __init__(self, starts: Floats, ends: Floats, curves: Ints) -> None:
        level = APART * curves[None]
        boxes = np.concatenate([np.minimum(starts, ends), level]), np.concatenate([np.maximum(starts, ends), level])
        self.tree = BoxTree(*boxes)
        self._starts, self._ends = np.ascontiguousarray(starts), np.ascontiguousarray(ends)  # see BoxTree
        self._edges = self._ends - self._starts
        squared = dot(self._edges, self._edges)
        # A segment without length is its start: divided by infinity every point is at fraction 0.
        self._squared = np.where(squared > TINY, squared, np.inf)
        self.extents: Floats = np.sqrt(squared)
        self.longest = float(self.extents.max())
        self.tangents: Floats = self._edges / np.sqrt(self._squared)

    def place(self, points: Floats, curves: Ints) -> Floats:
        """Points (3, N) with the fourth coordinate of their curves (N,)."""
        return np.concatenate([points, APART * curves[None]])

    def guess(self, points: Floats) -> Ints:
        """A segment of their own curve not far from the points (4, N)."""
        return self.tree.guess(points)

    def squared_distances(self, points: Floats, pieces: Ints) -> Floats:
        """Squared distances (M,) of points (4, M) to the segments ``pieces`` (M,)."""
        return self.locate(points[:3], pieces)[0]

    def locate(self, points: Floats, pieces: Ints) -> tuple[Floats, Floats, Floats]:
        """Squared distances (M,), nearest positions (3, M) and where on the segment, from 0 to 1 (M,)."""
        starts, ends, edges = (x.take(pieces, axis=1) for x in (self._starts, self._ends, self._edges))
        offset = points - starts
        # Divided, not multiplied by a reciprocal: then the end of the segment is at 1 exactly.
        fractions = (dot(offset, edges) / self._squared.take(pieces)).clip(0.0, 1.0)
        steps = fractions * edges
        positions = np.where(fractions < 1.0, starts + steps, ends)  # start + edge may miss the end by rounding
        offset -= steps
        return dot(offset, offset), positions, fractions
