"""Area vectors of single polygons."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Floats


def area_vector(positions: Floats, face: list[int]) -> Floats:
    """Of a polygon: its normal, as long as its area; as exact far from the origin as near it.

    Args:
        positions: (V, 3).
        face: vertices counterclockwise.
    """
    apart = positions[face] - positions[face[0]]
    (x, y, z), (a, b, c) = apart[:-1].T, apart[1:].T  # the first is zero, and so is what it adds at the end
    return np.array([y @ c - z @ b, z @ a - x @ c, x @ b - y @ a]) / 2
