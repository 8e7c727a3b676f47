"""Sides of polygons: whether they cross each other, and the sharpest angle between them."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Floats
from ..geometry import _polygon_sides


def sides_cross(corners: Floats, normal: Floats) -> bool:
    """Whether two sides of a polygon cross, seen along a normal. Such a polygon has parts that are turned over.

    Sides that only touch do not cross.

    Args:
        corners: (n, 3) in order.
        normal: (3,) of any length but zero.
    """
    return len(corners) > 3 and bool(_polygon_sides.sides_cross(corners[None], normal[None])[0])


def sharpest_angle(corners: Floats) -> float:
    """The smallest angle between sides that meet, of polygons (..., n, 3), in radians; 0 where one has no length."""
    ahead = np.roll(corners, -1, axis=-2) - corners
    back = -np.roll(ahead, 1, axis=-2)
    sines = np.linalg.norm(np.cross(ahead, back), axis=-1)
    return float(np.arctan2(sines, (ahead * back).sum(-1)).min())
