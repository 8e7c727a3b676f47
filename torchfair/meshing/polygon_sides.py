"""Whether sides of a polygon cross each other."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Floats


def sides_cross(corners: Floats, normal: Floats) -> bool:
    """Whether two sides of a polygon cross, seen along a normal. Such a polygon has parts that are turned over.

    Sides that only touch do not cross.

    Args:
        corners: (n, 3) in order.
        normal: (3,) of any length but zero.
    """
    if len(corners) == 3:
        return False
    ahead = np.roll(corners, -1, axis=0) - corners
    x, y, z = ahead.T
    across = np.stack([normal[1] * z - normal[2] * y, normal[2] * x - normal[0] * z, normal[0] * y - normal[1] * x], 1)
    left = across @ (corners - corners[0]).T
    left -= np.diag(left)[:, None]  # [i, j]: how far corner j lies to the left of side i
    np.fill_diagonal(left, 0.0)
    following = np.roll(left, -1, axis=1)
    np.fill_diagonal(following, 0.0)
    apart = left * following < 0  # [i, j]: the ends of side j lie on different sides of the line through side i
    return bool((apart & apart.T).any())
