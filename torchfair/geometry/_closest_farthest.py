"""How far points are from a mesh at most, without looking for the closest point of each."""

from __future__ import annotations

import math

import numpy as np
from torch import Tensor

from ..topology import Topology
from ._closest_boxes import Floats, Ints
from ._closest_cut import Pieces, cut_faces
from ._closest_points import to_columns
from ._closest_search import BLOCK, measure, nearest_pieces
from ._closest_triangles import Triangles

_FIRST = 256  # points searched before all others
_ROUNDING = 1e-12  # of distances from centres, relative to the coordinates


def largest_distance(points: Tensor, vertices: Tensor, topology: Topology, owners: Tensor | None = None) -> float:
    """The largest of the distances of points from a mesh, the same bit for bit as by :class:`ReferenceSurface`.

    No point is farther away than the faces around its owner are. Points are searched from the largest of these bounds
    on, until no bound is left above the largest distance found: mostly some hundreds.

    Args:
        points: (N, 3), N > 0.
        vertices: (V, 3) of the mesh.
        topology: Its connectivity, with a face.
        owners: (N,) a vertex of the mesh for each point, no vertex twice, the nearer the better; None where none is
            known to be near, and all points are searched.

    Raises:
        MeshError: a coordinate is not finite or beyond 1e70.
    """
    cut = cut_faces(to_columns(vertices, "vertices").T, topology)
    corners, columns = cut.points[cut.corners], to_columns(points, "points")
    shape = Triangles(corners)
    bounds = np.full(columns.shape[1], np.inf)
    if owners is not None:
        bounds = _bounds(shape, columns, cut, owners.cpu().numpy())
    order, reached, start = (-bounds).argsort(kind="stable"), 0.0, 0
    while start < order.size and bounds[order[start]] > reached:
        size = BLOCK if start or owners is None else _FIRST
        chosen = order[start : start + size]
        asked = columns[:, chosen[bounds[chosen] > reached]]
        # A tree of all pieces takes longer than everything else where few points are searched.
        near = shape if start or owners is None else _near(corners, asked, math.sqrt(bounds[order[0]]))
        squared = near.squared_distances(asked, nearest_pieces(near, asked))
        reached, start = max(reached, float(squared.max())), start + size
    return math.sqrt(reached)


def _near(corners: Floats, points: Floats, reach: float) -> Triangles:
    """Those of the pieces (T, 3, 3) that are not farther than ``reach`` from all of some points (3, n), and others."""
    from scipy.spatial import cKDTree

    centres = corners.mean(1)
    radii = np.sqrt(np.square(corners - centres[:, None]).sum(2).max(1))
    slack = _ROUNDING * (np.abs(corners).max() + reach)
    found = cKDTree(points.T).query(centres, distance_upper_bound=reach + radii.max() + 2 * slack)[0]
    return Triangles(corners[found <= reach + radii + slack])


def _bounds(shape: Triangles, points: Floats, cut: Pieces, owners: Ints) -> Floats:
    """(N,) squared distances of points (3, N) from the pieces at their owners; infinite where there are none."""
    of_vertex = np.full(cut.points.shape[0], -1)
    of_vertex[owners] = np.arange(owners.size)
    bounds = np.full(owners.size, np.inf)
    for corner in cut.corners.T:
        point = of_vertex[corner]
        piece = np.flatnonzero(point >= 0)
        np.minimum.at(bounds, point[piece], measure(shape, points, point[piece], piece))
    return bounds
