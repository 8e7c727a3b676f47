"""Whether sides of a polygon cross each other."""

from __future__ import annotations

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
