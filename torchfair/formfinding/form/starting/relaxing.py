"""Where vertices belong between fixed rims: at harmonic heights over a plan, or on a surface of small area."""

from __future__ import annotations

import numpy as np

from ....linear import factorise
from .patch import Floats, Ints, Patch

_LEAST_WEIGHT = 0.02  # of edges that are not Delaunay, so that no system is singular


def harmonic_heights(patch: Patch, direction: Floats) -> Floats:
    """The points (V, 3) with inner vertices at the heights along a unit vector that are harmonic over the plan."""
    heights = patch.points @ direction
    plan = patch.points - heights[:, None] * direction
    found = _harmonic(patch, plan, heights[:, None])[:, 0]
    return plan + found[:, None] * direction


def smaller_area(patch: Patch) -> Floats:
    """The points (V, 3) with inner vertices where they are harmonic over the surface as it is.

    Repeated, that leads to a minimal surface (Pinkall and Polthier 1993).
    """
    return _harmonic(patch, patch.points, patch.points)


def _harmonic(patch: Patch, places: Floats, values: Floats) -> Floats:
    """(V, k) values, at inner vertices harmonic by the cotangents of triangles between ``places``."""
    from scipy.sparse import coo_array, diags_array

    count, inside = len(patch.points), patch.inside
    if not inside.any():
        return values
    ends, weights = _cotangents(places, patch.faces)
    keys, numbers = np.unique(np.sort(ends, axis=1) @ np.array([count, 1]), return_inverse=True)
    total = np.bincount(numbers, weights).clip(_LEAST_WEIGHT)
    v, w = np.divmod(keys, count)
    rows, columns = np.concatenate([v, w]), np.concatenate([w, v])
    edges = coo_array((np.concatenate([total, total]), (rows, columns)), shape=(count, count)).tocsr()
    laplacian = (diags_array(np.asarray(edges.sum(1)).ravel()) - edges).tocsr()[inside]
    import torch

    pulls = torch.from_numpy(-(laplacian[:, ~inside] @ values[~inside]))
    result = values.copy()
    result[inside] = factorise(laplacian[:, inside]).solve(pulls).values.numpy()
    return result


def _cotangents(places: Floats, faces: Ints) -> tuple[Ints, Floats]:
    """(3 F, 2) edges, one for every corner that they lie opposite to, and half the cotangents there."""
    p = places[faces]
    ahead, back = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    sine = np.linalg.norm(np.cross(ahead, back), axis=2)
    cotangents = 0.5 * (ahead * back).sum(2) / np.maximum(sine, 1e-300)
    ends = np.stack([np.roll(faces, -1, axis=1), np.roll(faces, 1, axis=1)], 2)
    return ends.reshape(-1, 2), cotangents.clip(-1e3, 1e3).ravel()
