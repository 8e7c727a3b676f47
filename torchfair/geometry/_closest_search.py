"""The nearest piece of a shape for many points at once, exactly; with and without a warm start."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ._closest_boxes import BoxTree, Floats, Ints

_SAFETY = 5e-14  # rounding of a distance, relative to the lengths involved, several times over
BLOCK = 4096  # points searched together: the work arrays stay in the cache
PAIRS = 1 << 20  # pairs of a point and a box held at once
_MEASURED = 1 << 14  # pairs measured together
PARTS = 8  # a block with too many pairs is cut into as many


class Shape(Protocol):
    """Pieces such as triangles or segments.

    Attributes:
        tree: boxes of the pieces.
        extents: (T,) longest edge of every piece.
        longest: the largest of the extents.
    """

    extents: Floats
    longest: float

    @property
    def tree(self) -> BoxTree:
        """See above."""
        ...

    def guess(self, points: Floats) -> Ints:
        """A piece near each of the points (d, N), not always the nearest."""
        ...

    def squared_distances(self, points: Floats, pieces: Ints) -> Floats:
        """Squared distances (M,) of points (d, M) to the pieces of the same column."""
        ...


def nearest_pieces(shape: Shape, points: Floats) -> Ints:
    """The nearest piece of each of the points (d, N); of equally near ones that of the lowest number."""
    blocks = [_nearest(shape, points[:, a : a + BLOCK]) for a in range(0, points.shape[1], BLOCK)]
    return np.concatenate([np.zeros(0, np.int64), *blocks])


def _nearest(shape: Shape, points: Floats) -> Ints:
    guess = np.sqrt(shape.squared_distances(points, shape.guess(points)))
    pairs = shape.tree.pairs(points, guess + margin(shape, guess), PAIRS)
    if pairs is None:  # a point as far from very many pieces: fewer points at a time
        parts = np.array_split(points, min(PARTS, points.shape[1]), axis=1)
        return np.concatenate([_nearest(shape, part) for part in parts])
    return lowest_piece(*pairs, measure(shape, points, *pairs))


def margin(shape: Shape, distance: Floats) -> Floats:
    """More than all rounding in a computed distance.

    Bounds are widened by it. So the pieces that are measured always include the one whose computed distance
    is the smallest of all pieces, and the answer is, bit for bit, that of measuring every piece.
    """
    return _SAFETY * (distance + shape.longest)


def measure(shape: Shape, points: Floats, point: Ints, piece: Ints) -> Floats:
    """Squared distances (M,) of pairs of a point and a piece."""
    blocks = [slice(a, a + _MEASURED) for a in range(0, max(piece.size, 1), _MEASURED)]
    return np.concatenate([shape.squared_distances(points.take(point[b], axis=1), piece[b]) for b in blocks])


def lowest_piece(point: Ints, piece: Ints, squared: Floats) -> Ints:
    """The nearest piece of every point that occurs in the pairs (M,), M > 0, which are sorted by point."""
    starts = np.flatnonzero(np.diff(point, prepend=-1))
    smallest = np.minimum.reduceat(squared, starts).repeat(np.diff(starts, append=point.size))
    tied = np.where(squared == smallest, piece, np.iinfo(np.int64).max)
    lowest: Ints = np.minimum.reduceat(tied, starts)
    return lowest
