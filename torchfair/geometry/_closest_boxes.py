"""A balanced tree of axis-aligned boxes: which items can lie within a given distance of a point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_TOP = 3  # depth at which searches start; all boxes of that depth are looked at
_STEP = 2  # levels taken at once on the way down
_GUESS_STEP = 3


class BoxTree:
    """Boxes of items, pairwise merged into larger boxes up to one box around everything.

    Every level is one array, node ``n`` of a level has the children ``2 n`` and ``2 n + 1`` of the next, so
    the search goes down level by level for all points at once. There are d coordinates, in the first axis::

        level 0               [ all items ]
        level 1        [ half ]           [ half ]
        level 2     [ 0 ]   [ 1 ]      [ 2 ]   [ 3 ]     median cuts across the longest side

    Args:
        low, high: (d, T) corners of the box of every item, T > 0.

    Attributes:
        items: (2^depth,) the item at each leaf; boxes of leaves without one are infinitely far from everything.
        depth: number of the level of leaves.
    """

    def __init__(self, low: Floats, high: Floats) -> None:
        self.items, empty = _median_order(low + high)
        # With the upper corner negated one minimum merges both corners; no point is near an empty box.
        # Rows are contiguous: of others `take` copies the whole level each time.
        boxes = np.concatenate([low, -high]).take(self.items, axis=1)
        boxes[:, empty] = np.inf
        levels = [boxes]
        while levels[-1].shape[1] > 1:
            levels.append(np.minimum(levels[-1][:, ::2], levels[-1][:, 1::2]))
        half = low.shape[0]
        self._levels = [np.concatenate([level[:half], -level[half:]]) for level in reversed(levels)]

    @property
    def depth(self) -> int:
        return len(self._levels) - 1

    def level(self, depth: int) -> Floats:
        """(2 d, 2^depth) low and high corners of the boxes of a level."""
        return self._levels[depth]

    def guess(self, points: Floats) -> Ints:
        """An item near each of the points (d, N), not always the nearest."""
        level = min(_TOP, self.depth)
        node = _squared_gaps(self._levels[level][:, :, None], points[:, None]).argmin(0)
        while level < self.depth:
            step = min(_GUESS_STEP, self.depth - level)
            level += step
            children = (node << step) + np.arange(1 << step)[:, None]
            nearest = _squared_gaps(self._levels[level].take(children, axis=1), points[:, None]).argmin(0)
            node = (node << step) + nearest
        items: Ints = self.items.take(node)
        return items

    def pairs(self, points: Floats, radius: Floats, limit: int) -> tuple[Ints, Ints] | None:
        """All pairs (point, item) whose box is not farther from the point than ``radius``.

        Args:
            points: (d, N).
            radius: (N,).
            limit: largest number of pairs to look at for more than one point.

        Returns:
            Numbers of points (M,), ascending, and of items (M,); None if there are more than ``limit``.
        """
        squared = radius * radius
        level = min(_TOP, self.depth)
        gaps = _squared_gaps(self._levels[level][:, None], points[:, :, None])
        point, node = np.nonzero(gaps <= squared[:, None])
        while level < self.depth:
            step = min(_STEP, self.depth - level)
            if point.size << step > limit and squared.size > 1:
                return None
            level += step
            point = point.repeat(1 << step)
            node = ((node << step)[:, None] + np.arange(1 << step)).ravel()
            boxes = self._levels[level].take(node, axis=1)
            near = np.flatnonzero(_squared_gaps(boxes, points.take(point, axis=1)) <= squared.take(point))
            point, node = point.take(near), node.take(near)
        return point, self.items.take(node)


def _squared_gaps(boxes: Floats, points: Floats) -> Floats:
    """Squared distances of points (d, ...) to boxes (2 d, ...), zero inside."""
    half = points.shape[0]
    gap = boxes[:half] - points
    np.maximum(gap, points - boxes[half:], out=gap)
    np.maximum(gap, 0.0, out=gap)
    gap *= gap
    total: Floats = gap[0]
    for row in gap[1:]:
        total += row
    return total


def _median_order(centres: Floats) -> tuple[Ints, npt.NDArray[np.bool_]]:
    """Items in the order of the leaves, and the mask of leaves that stay empty.

    The number of leaves is a power of two. Missing items are filled up with copies, which are marked as
    empty: a copy sorts beside its original and so disturbs no cut.
    """
    dimension, count = centres.shape
    depth = max(count - 1, 0).bit_length()
    leaf = np.arange(1 << depth, dtype=np.int64)
    keys = centres[:, leaf % count].reshape(dimension, 1, -1)
    for level in range(depth):
        width = 1 << (depth - level)
        longest = (keys.max(2) - keys.min(2)).argmax(0)
        key = keys[longest, np.arange(1 << level)]
        order = np.argpartition(key, width // 2, axis=1)
        order += np.arange(0, leaf.size, width)[:, None]
        leaf = leaf.take(order.ravel())
        keys = keys.reshape(dimension, -1).take(order.ravel(), axis=1).reshape(dimension, 2 << level, -1)
    return leaf % count, leaf >= count
