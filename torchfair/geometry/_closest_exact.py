"""Normals of triangles without cancellation.

The cross product of two nearly parallel edges cancels: for a triangle 1e9 times as long as high the plainly
computed normal leans by 1e-7, along the triangle too, and so the height above it is wrong by 1e-7 of its
length. Products and differences below come with their rounding errors, so that the normal is perpendicular to
the edges to the last bits. That is all a distance needs: the rounding of the edges themselves only turns a
thin triangle about its own long axis.
"""

from __future__ import annotations

import numpy as np

from ._closest_boxes import Floats

_SPLIT = 134217729.0  # 2^27 + 1 cuts 53 bits into two halves whose products are exact


def unit_normals(corners: Floats) -> Floats:
    """Unit normals (3, T) of triangles with corners (3, 3, T), axes coordinate, corner, triangle.

    The zero vector where the two edges are exactly parallel.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.empty_like(first)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        plus, plus_error = _product(first[i], second[j])
        minus, minus_error = _product(first[j], second[i])
        value, error = _difference(plus, minus)
        normal[k] = value + (error + (plus_error - minus_error))
    largest = np.abs(normal).max(0)  # dividing by it first keeps squares in range
    normal /= np.where(largest > 0, largest, 1.0)
    length = np.sqrt((normal * normal).sum(0))
    unit: Floats = normal / np.where(length > 0, length, 1.0)
    return unit


def _difference(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """``a - b`` and its rounding error (Knuth's two-sum)."""
    value = a - b
    taken = value - a
    return value, (a - (value - taken)) - (b + taken)


def _product(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """``a * b`` and its rounding error (Dekker's product of halves)."""
    value = a * b
    a_high, b_high = _high_half(a), _high_half(b)
    a_low, b_low = a - a_high, b - b_high
    return value, a_low * b_low - (((value - a_high * b_high) - a_low * b_high) - a_high * b_low)


def _high_half(a: Floats) -> Floats:
    scaled = _SPLIT * a
    high: Floats = scaled - (scaled - a)
    return high
