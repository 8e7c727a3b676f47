"""Distances of points to triangles, right to rounding however thin the triangle."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ._closest_boxes import BoxTree, Floats, Ints
from ._closest_exact import unit_normals

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

TINY = 1e-290  # squared lengths below it are taken as zero


class Nearest(NamedTuple):
    """Where points (3, M) are nearest to the triangles paired with them.

    Attributes:
        squared: (M,) squared distance.
        inside: (M,) whether the foot of the perpendicular is inside the triangle.
        height: (M,) distance from the plane, positive on the side of the normal.
        inward: (3, M) distance of the foot from each edge times its length, positive on the inner side.
        along: (3, M) the nearest point of each edge, 0 at its start and 1 at its end.
        from_edges: (3, M) squared distances to the edges.
    """

    squared: Floats
    inside: npt.NDArray[np.bool_]
    height: Floats
    inward: Floats
    along: Floats
    from_edges: Floats


class Triangles:
    r"""Triangles in space, prepared for distances.

    Either the foot of the perpendicular lies inside the triangle, and then the height is the distance, or
    the nearest point is on one of the three edges::

                    2
                   / \
               2  /   \  1        edge k runs from corner k to the next one
                 /     \
                0 ----- 1
                    0

    Edges are measured from their own start, so the distance at a corner is exactly 0. A triangle without
    area is its three edges. What searches need is made when first asked for.

    Args:
        corners: (T, 3, 3) positions of the three corners, T > 0.
    """

    def __init__(self, corners: Floats) -> None:
        self._table = np.empty((12, corners.shape[0]))  # the largest of all: what follows from it is not kept
        starts = self._table[:9].reshape(3, 3, -1)  # axes: coordinate, corner, triangle
        starts[:] = corners.transpose(2, 1, 0)
        edges = _edges(starts)
        self.extents: Floats = np.sqrt(dot(edges, edges).max(0))
        self.longest = float(self.extents.max())
        del edges
        self._table[9:] = unit_normals(starts)

    def prepare(self) -> Triangles:
        """Makes now what the first search would make."""
        _ = self.tree, self._centres
        return self

    @cached_property
    def tree(self) -> BoxTree:
        """Boxes of the triangles."""
        starts = self._table[:9].reshape(3, 3, -1)
        return BoxTree(starts.min(1), starts.max(1))

    @cached_property
    def _centres(self) -> cKDTree:
        from scipy.spatial import cKDTree  # here, because importing torchfair should stay cheap

        centres = self._table[:9].reshape(3, 3, -1).mean(1).T
        return cKDTree(np.ascontiguousarray(centres), balanced_tree=False, compact_nodes=False)

    def guess(self, points: Floats) -> Ints:
        """The triangle with the nearest centre, for points (3, N); a far better first bound than boxes give."""
        nearest: Ints = np.asarray(self._centres.query(points.T)[1], np.int64)
        return nearest

    def squared_distances(self, points: Floats, pieces: Ints) -> Floats:
        """Squared distances (M,) of points (3, M) to the triangles ``pieces`` (M,)."""
        return self.nearest(points, pieces).squared

    def nearest(self, points: Floats, pieces: Ints) -> Nearest:
        """Where points (3, M) are nearest to the triangles ``pieces`` (M,)."""
        return _nearest(points, self._table.take(pieces, axis=1))

    def locate(self, points: Floats, pieces: Ints) -> tuple[Floats, Floats, Floats]:
        """Squared distances (M,), nearest positions (3, M) and their barycentric coordinates (3, M)."""
        table = self._table.take(pieces, axis=1)
        found = _nearest(points, table)
        # Entries of the nearest edge and of its two corners in arrays (3, M) laid out flat.
        edge = found.from_edges.argmin(0)
        column = np.arange(pieces.size)
        start = edge * pieces.size + column
        end = (edge + 1) % 3 * pieces.size + column
        along = found.along.take(start)
        corners = table[:9].reshape(3, -1)
        edges = _edges(table[:9].reshape(3, 3, -1)).reshape(3, -1)
        on_edge = corners.take(start, axis=1) + along * edges.take(start, axis=1)
        on_edge = np.where(along < 1.0, on_edge, corners.take(end, axis=1))  # start + edge may miss the end
        on_edge_weights = np.zeros((3, pieces.size))
        on_edge_weights.put(start, 1.0 - along)
        on_edge_weights.put(end, along)
        # The corner opposite to an edge weighs as much as the triangle between that edge and the foot.
        areas = found.inward[[1, 2, 0]]
        total = np.where(found.inside, areas.sum(0), 1.0)
        positions = np.where(found.inside, points - found.height * table[9:], on_edge)
        weights = np.where(found.inside, areas / total, on_edge_weights)
        return found.squared, positions, weights


def _nearest(points: Floats, table: Floats) -> Nearest:
    """Where points (3, M) are nearest to the triangles described by the columns of ``table`` (12, M)."""
    starts, normals = table[:9].reshape(3, 3, -1), table[9:]
    edges = _edges(starts)
    offset = points[:, None] - starts
    along, squared = dot(offset, edges), dot(edges, edges)
    # An edge without length is its start: divided by infinity every point is at place 0.
    along /= np.where(squared > TINY, squared, np.inf)  # not times the reciprocal: the end of an edge is at 1 exactly
    np.clip(along, 0.0, 1.0, out=along)
    inward = dot(offset, _cross(normals[:, None], edges))
    height = dot(offset[:, 0], normals)
    offset -= along * edges
    from_edges = dot(offset, offset)
    inside = (inward[0] > 0) & (inward[1] > 0) & (inward[2] > 0)
    squared = np.where(inside, height * height, from_edges.min(0))
    return Nearest(squared, inside, height, inward, along, from_edges)


def _edges(starts: Floats) -> Floats:
    """(3, 3, M) from each corner to the next, for axes coordinate, corner, triangle."""
    ahead: Floats = starts[:, [1, 2, 0]]
    ahead -= starts
    return ahead


def _cross(a: Floats, b: Floats) -> Floats:
    """Vector product along the first axis, of length three."""
    product: Floats = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[i], b[j], out=product[k])
        product[k] -= a[j] * b[i]
    return product


def dot(a: Floats, b: Floats) -> Floats:
    """Scalar product along the first axis, of length three, added up in the same order for any number of columns."""
    product = a * b
    total: Floats = product[0]
    total += product[1]
    total += product[2]
    return total
