"""Whether sides of polygons cross each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def sides_cross(corners: Floats, normals: Floats, touching: float = 0.0) -> npt.NDArray[np.bool_]:
    """(n,) whether two sides of polygons (n, size, 3) cross, seen along normals (n, 3) of any length but zero.

    Such a polygon has parts that are turned over. Sides that only touch do not cross: where a corner is as near the
    line of a side as ``touching``, a share of the size of the polygon, or nearer.
    """
    corners = corners - corners[:, :1]
    x, y, z = np.moveaxis(np.roll(corners, -1, axis=1) - corners, 2, 0)
    a, b, c = normals.T[..., None]
    across = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], 2)
    left = across @ np.swapaxes(corners, 1, 2)
    left -= np.diagonal(left, axis1=1, axis2=2)[..., None].copy()  # [i, j]: how far corner j lies to the left of side i
    if touching:
        sides, size = np.linalg.norm(across, axis=2)[..., None], np.linalg.norm(corners, axis=2).max(1)[:, None, None]
        left[np.abs(left) <= touching * sides * size] = 0.0
    apart = left * np.roll(left, -1, axis=2) < 0  # [i, j]: the ends of side j are on both sides of side i
    return np.asarray((apart & np.swapaxes(apart, 1, 2)).any((1, 2)))
