"""The nearest pieces of points that move a little between one search and the next, exactly."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ._closest_boxes import Floats, Ints
from ._closest_search import BLOCK, PAIRS, PARTS, Shape, lowest_piece, margin, measure

_CANDIDATES = 16  # pieces kept per point
_SERVES = 2  # steps like the last one for which candidates should serve
_SKIN = 0.2  # how far beyond the nearest piece candidates are gathered, in extents of a piece


class PieceTracker:
    """Keeps for every point the pieces around the place (its anchor) where it was searched last.

    Every piece that is not among the candidates of a point was at least ``radius`` away from its anchor.
    After the point has moved by m it is at least ``radius - m`` away, so the nearest candidate is the
    nearest piece of all if it is nearer than that; if not, the point is searched again and gets a new
    anchor. Of the candidates only those are measured whose distance from the anchor was at most the
    distance to the last piece + m.

    Far from the shape many pieces are about as near, and gathering costs as much as two searches. So candidates
    of a point are gathered once its last step was short enough for them to serve several times, or at once if it
    starts nearer to the shape than they reach; before that ``radius`` is the distance to the nearest piece.
    """

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self._skin = _SKIN * np.minimum(shape.extents, shape.extents.mean())
        self._previous: Floats = np.zeros((0, 0))

    def nearest(self, points: Floats) -> Ints:
        """The same as :func:`nearest_pieces` for the points (d, N), faster if they are near the last ones."""
        if points.shape != self._previous.shape:
            self._reset(points)
            return self._last.copy()
        blocks = (slice(first, first + BLOCK) for first in range(0, points.shape[1], BLOCK))
        lost = np.concatenate([np.zeros(0, np.int64), *(self._follow(block, points) for block in blocks)])
        if lost.size:
            skin = self._skin[self._last[lost]]
            step = _lengths(points[:, lost] - self._previous[:, lost])
            self._search(lost, points, np.where(_SERVES * step < skin, skin, 0.0))
        self._previous = points.copy()
        return self._last.copy()

    def _follow(self, block: slice, points: Floats) -> Ints:
        """Finds the nearest pieces of some of all the points (d, N); the numbers of those without candidates."""
        here, last = points[:, block], self._last[block]
        bound = np.sqrt(self._shape.squared_distances(here, last)) + _lengths(here - self._anchors[:, block])
        bound += margin(self._shape, bound)
        known = bound < self._radius[block]
        row, column = np.nonzero(self._distances[block] <= np.where(known, bound, -1.0)[:, None])
        if row.size:
            piece = self._candidates[block][row, column].astype(np.int64)
            last[known] = lowest_piece(row, piece, measure(self._shape, here, row, piece))  # a view
        lost: Ints = block.start + np.flatnonzero(~known)
        return lost

    def _reset(self, points: Floats) -> None:
        count = points.shape[1]
        self._previous = points.copy()
        self._anchors = points.copy()
        self._radius = np.zeros(count)
        self._candidates = np.zeros((count, _CANDIDATES), np.int32)
        self._distances = np.full((count, _CANDIDATES), np.inf, np.float32)
        self._last = self._shape.guess(points)
        skin = self._skin[self._last]
        self._search(np.arange(count), points, np.where(self._reach(points) < skin, skin, 0.0))

    def _reach(self, points: Floats) -> Floats:
        """Distances (N,) of all the points (d, N) from their last pieces."""
        blocks = [slice(first, first + BLOCK) for first in range(0, max(points.shape[1], 1), BLOCK)]
        return np.concatenate([np.sqrt(self._shape.squared_distances(points[:, b], self._last[b])) for b in blocks])

    def _search(self, rows: Ints, points: Floats, skin: Floats) -> None:
        """Searches some rows of all the points (d, N) anew; ``skin`` has one entry for each of them."""
        for first in range(0, rows.size, BLOCK):
            block = slice(first, first + BLOCK)
            self._anchor(rows[block], points[:, rows[block]], skin[block])

    def _anchor(self, rows: Ints, points: Floats, skin: Floats) -> None:
        """Makes the points (d, n) the anchors of ``rows``, with all pieces up to ``skin`` beyond the last one."""
        reach = np.sqrt(self._shape.squared_distances(points, self._last[rows]))
        reach += margin(self._shape, reach) + skin
        pairs = self._shape.tree.pairs(points, reach, PAIRS)
        if pairs is None:
            for part in np.array_split(np.arange(rows.size), min(PARTS, rows.size)):
                self._anchor(rows[part], points[:, part], skin[part])
            return
        point, piece = pairs
        squared = measure(self._shape, points, point, piece)
        self._anchors[:, rows] = points
        self._last[rows] = lowest_piece(point, piece, squared)
        self._keep(rows, reach, point, piece, np.sqrt(squared))

    def _keep(self, rows: Ints, reach: Floats, point: Ints, piece: Ints, distance: Floats) -> None:
        """Stores the nearest of the pieces found within ``reach``."""
        order = np.lexsort((distance, point))
        piece, distance = piece[order], distance[order]
        count = np.bincount(point, minlength=rows.size)
        start = count.cumsum() - count
        rank = np.arange(point.size) - start[point]
        kept = rank < _CANDIDATES
        self._distances[rows] = np.inf
        self._distances[rows[point[kept]], rank[kept]] = _below(distance[kept])
        self._candidates[rows[point[kept]], rank[kept]] = piece[kept]
        # Where the list is full, everything beyond it is at least as far as the first piece left out.
        self._radius[rows] = reach
        full = np.flatnonzero(count > _CANDIDATES)
        self._radius[rows[full]] = distance[start[full] + _CANDIDATES]


def _below(distances: Floats) -> npt.NDArray[np.float32]:
    """In single precision, none larger than it was: candidates that might be near are then measured as they are."""
    with np.errstate(over="ignore"):
        single = distances.astype(np.float32)
    return np.where(single > distances, np.nextafter(single, np.float32(-np.inf)), single)


def _lengths(vectors: Floats) -> Floats:
    """Euclidean lengths (N,) of vectors (d, N)."""
    squared: Floats = (vectors * vectors).sum(0)
    return np.sqrt(squared)
