"""The part of the convex hull between several rims."""

from __future__ import annotations

import numpy as np

from ...._graph import connected
from .patch import Edges, Floats, Ints, edges_of


def hull_between(points: Floats, rims: Ints, edges: Ints) -> Ints | None:
    """Triangles (F, 3) of the convex hull of rims that meet all of them and end there.

    The hull is cut along the rims; the part that has vertices of all of them is taken if it is bounded by all of them
    alone. None where there is no such part, as with rims that do not lie on the hull.

    Args:
        points: (V, 3).
        rims: (V,) which rim a point belongs to.
        edges: (E, 2) of the rims.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    faces = hull.simplices.astype(np.int64)
    outward = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    turned = (outward * hull.equations[:, :3]).sum(1) < 0.0
    faces[turned] = faces[turned][:, ::-1]
    known = edges_of(faces)
    keys = known.ends @ np.array([len(points), 1])
    rim_keys = np.sort(edges, axis=1) @ np.array([len(points), 1])
    if not np.isin(rim_keys, keys).all():
        return None
    parts = connected(_sides(known, np.isin(keys, rim_keys)), len(faces))
    for part in np.unique(parts):
        mine = faces[parts == part]
        outline = edges_of(mine)
        cut = outline.ends[outline.boundary] @ np.array([len(points), 1])
        if len(cut) == len(rim_keys) and np.isin(rim_keys, cut).all() and len(np.unique(rims[mine])) > 1:
            found: Ints = mine
            return found
    return None


def _sides(known: Edges, cut: np.ndarray) -> Ints:
    """(n, 2) faces with a common edge that is not cut."""
    faces = np.repeat(np.arange(len(known.of_faces)), 3)
    order = np.argsort(known.of_faces.ravel(), kind="stable")
    pairs = faces[order].reshape(-1, 2)  # of a closed surface: two faces for every edge
    kept: Ints = pairs[~cut]
    return kept
