"""Cubic splines through the points of several curves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._closest_boxes import Floats, Ints


class Knots(NamedTuple):
    """The points of several curves in a row, S segments in all.

    Attributes:
        starts, ends: (S, 3) ends of the segments.
        before, after: (S,) the segments beside each segment along its curve; itself at an end of an open curve.
        is_first, is_last: (S,) bool, at the start or at the end of an open curve.
        curves: (S,) ascending.
    """

    starts: Floats
    ends: Floats
    before: Ints
    after: Ints
    is_first: np.ndarray
    is_last: np.ndarray
    curves: Ints

    @classmethod
    def of(cls, points: list[Floats], closed: list[bool]) -> Knots:
        """Of curves through points (n, 3) each, n >= 2."""
        starts = np.concatenate([x if ring else x[:-1] for x, ring in zip(points, closed, strict=True)])
        ends = np.concatenate([np.roll(x, -1, 0) if ring else x[1:] for x, ring in zip(points, closed, strict=True)])
        counts = np.array([len(x) if ring else len(x) - 1 for x, ring in zip(points, closed, strict=True)])
        curves = np.repeat(np.arange(len(points)), counts)
        last = np.cumsum(counts) - 1
        first = last + 1 - counts
        numbers, is_open = np.arange(len(starts)), ~np.array(closed)
        before, after = numbers - 1, numbers + 1
        before[first], after[last] = np.where(is_open, first, last), np.where(is_open, last, first)
        return cls(starts, ends, before, after, before == numbers, after == numbers, curves)


def spline_coefficients(knots: Knots) -> Floats:
    """Coefficients (S, 4, 3) of ``a0 + a1 u + a2 u^2 + a3 u^3``, u from 0 to 1 along each segment.

    The parameter is the length of chords, so speeds are near 1 and a circle is met to fourth order however uneven its
    points are. Second derivatives M at the points fulfil the usual tridiagonal system. On the first and the last
    segment of an open curve they are constant: continued linearly ("not a knot") they grow without bound where a long
    segment follows a short one.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import splu

    chords = knots.ends - knots.starts
    lengths = np.linalg.norm(chords, axis=1)[:, None]
    slopes = chords / lengths
    count, before = len(chords), knots.before
    # Unknowns: M at the start of every segment, then at the ends of open curves. Rows are in this order.
    open_ends = np.flatnonzero(knots.is_last)
    number_of_end = np.where(knots.is_last, 0, knots.after)
    number_of_end[open_ends] = count + np.arange(len(open_ends))
    single = knots.is_first & knots.is_last
    inner = np.flatnonzero(~knots.is_first)
    firsts = np.flatnonzero(knots.is_first)
    here, there = lengths[:, 0], lengths[before, 0]
    rows = [inner, inner, inner, firsts, firsts, number_of_end[open_ends], number_of_end[open_ends]]
    columns = [before[inner], inner, number_of_end[inner], firsts, number_of_end[firsts]]
    columns += [number_of_end[open_ends], open_ends]
    values = [there[inner], 2.0 * (there + here)[inner], here[inner], np.ones(len(firsts)), single[firsts] - 1.0]
    values += [np.ones(len(open_ends)), single[open_ends] - 1.0]
    size = count + len(open_ends)
    matrix = coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (size, size))
    right = np.zeros((size, 3))
    right[inner] = 6.0 * (slopes[inner] - slopes[before[inner]])
    bends = splu(matrix.tocsc()).solve(right)
    start, end = bends[:count], bends[number_of_end]
    squared = lengths**2
    linear = chords - squared * (2.0 * start + end) / 6.0
    return np.stack([knots.starts, linear, 0.5 * squared * start, squared * (end - start) / 6.0], 1)
