"""Strips of quads laid flat."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def unroll(rulings: Floats) -> Floats:
    r"""Lays a strip flat, quad by quad.

    ::

        d --------- c      each quad is split along b d; both triangles keep their edge lengths, and quads share
        |         / |      rulings, so everything keeps its length but the diagonal a c of a quad that is not planar
        |      /    |
        a --- ----- b

    Args:
        rulings: (n, 2, 3) lower and upper ends of the rulings, ``n >= 2``; no quad is degenerate.

    Returns:
        (n, 2, 2) points; the first ruling goes from the origin upwards, the strip to its right.
    """
    a, d = rulings[:-1, 0], rulings[:-1, 1]
    b, c = rulings[1:, 0], rulings[1:, 1]
    up, across = _local(d - a, b - a)  # of b, in the frame of the ruling a d
    base = np.hypot(np.linalg.norm(d - a, axis=1) - up, across)  # |b d|
    along, aside = _local(d - b, c - b)  # of c, in the frame of b d
    to_b = across + 1j * up
    to_d = 1j * np.linalg.norm(d - a, axis=1) - to_b
    ruling = (along - 1j * aside) * to_d / base  # from b to c
    length = np.abs(ruling)
    turns = np.cumprod(np.concatenate([[1.0 + 0j], ruling / (1j * length)]))
    lower = np.concatenate([[0j], np.cumsum(turns[:-1] * to_b)])
    upper = lower + turns * 1j * np.concatenate([np.linalg.norm(d[:1] - a[:1], axis=1), length])
    points = np.stack([lower, upper], axis=1)
    return np.stack([points.real, points.imag], axis=2)


def _local(axis: Floats, vector: Floats) -> tuple[Floats, Floats]:
    """Components of ``vector`` along ``axis`` and, never negative, orthogonal to it."""
    length = np.linalg.norm(axis, axis=1)
    along: Floats = (axis * vector).sum(1) / length
    return along, np.linalg.norm(np.cross(axis, vector), axis=1) / length


def quads_of(flat: Floats) -> Floats:
    """(n-1, 4, 2) corners of the quads between rulings (n, 2, 2), counterclockwise."""
    return np.stack([flat[:-1, 0], flat[1:, 0], flat[1:, 1], flat[:-1, 1]], axis=1)
