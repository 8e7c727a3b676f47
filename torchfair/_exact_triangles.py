"""Whether two triangles meet, decided in rational arithmetic: for the few pairs where rounding could tell otherwise."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt

Point = tuple[Fraction, ...]


def meet_exactly(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], *, common: bool = False) -> bool:
    """Whether triangles (3, 3) of some area have a common point; with ``common``, one beside their first corners.

    Args:
        a: Corners of one.
        b: Corners of the other.
        common: Their first corners are the same. Then another common point needs a side opposite to one of these
            corners that meets the other triangle.
    """
    p, q = ([tuple(Fraction(float(x)) for x in row) for row in corners] for corners in (a, b))
    if common:
        return _crosses(p[1], p[2], q) or _crosses(q[1], q[2], p)
    sides = ((0, 1), (1, 2), (2, 0))
    return any(_crosses(x[i], x[j], y) for x, y in ((p, q), (q, p)) for i, j in sides)


def _crosses(p: Point, q: Point, triangle: list[Point]) -> bool:
    """Whether a segment meets a triangle."""
    a, b, c = triangle
    one, other = _volume(a, b, c, p), _volume(a, b, c, q)
    if one * other > 0:
        return False
    if one == 0 and other == 0:
        return _crosses_in_plane(p, q, triangle)
    turns = [_volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)]
    return all(turn >= 0 for turn in turns) or all(turn <= 0 for turn in turns)


def _crosses_in_plane(p: Point, q: Point, triangle: list[Point]) -> bool:
    normal = _cross(_minus(triangle[1], triangle[0]), _minus(triangle[2], triangle[0]))
    drop = max(range(3), key=lambda axis: abs(normal[axis]))
    flat = [tuple(x for axis, x in enumerate(point) if axis != drop) for point in (p, q, *triangle)]
    p, q, *corners = flat
    if _inside(p, corners) or _inside(q, corners):
        return True
    return any(_segments_meet(p, q, corners[i], corners[i - 1]) for i in range(3))


def _inside(p: Point, corners: list[Point]) -> bool:
    turns = [_turn(corners[i - 1], corners[i], p) for i in range(3)]
    return all(turn >= 0 for turn in turns) or all(turn <= 0 for turn in turns)


def _segments_meet(p: Point, q: Point, a: Point, b: Point) -> bool:
    """In the plane, where no end of the first lies in a triangle that the second is a side of."""
    return _turn(p, q, a) * _turn(p, q, b) <= 0 and _turn(a, b, p) * _turn(a, b, q) < 0


def _turn(a: Point, b: Point, c: Point) -> Fraction:
    u, v = _minus(b, a), _minus(c, a)
    return u[0] * v[1] - u[1] * v[0]


def _volume(a: Point, b: Point, c: Point, d: Point) -> Fraction:
    normal, way = _cross(_minus(b, a), _minus(c, a)), _minus(d, a)
    return sum((x * y for x, y in zip(normal, way, strict=True)), Fraction(0))


def _cross(u: Point, v: Point) -> Point:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def _minus(a: Point, b: Point) -> Point:
    return tuple(x - y for x, y in zip(a, b, strict=True))
