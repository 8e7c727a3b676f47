"""What faces that come from elsewhere may mean: columns of an array, padding, triangles with a corner twice."""

from __future__ import annotations

import numpy as np

from ._names import Ints

_ROWS = 3  # of an array (3, F)
_QUAD = 4


def of_sizes(offsets: Ints) -> str:
    """A hint where there are three faces of one size, as if they were the columns of an array; else empty.

    Args:
        offsets: (F+1,) of packed faces.
    """
    sizes = np.diff(offsets)
    if len(sizes) != _ROWS or sizes[0] in (3, _QUAD) or (sizes != sizes[0]).any():
        return ""
    return f" If the columns are the faces, an array (3, {sizes[0]}), pass faces.T."


def of_repeats(corners: Ints, offsets: Ints, repeated: Ints) -> str:
    """A hint where all faces with a repeated corner are quads ``[a, b, c, c]``, or where faces may be columns.

    Args:
        corners: (H,) vertex at each corner.
        offsets: (F+1,) of packed faces.
        repeated: faces that use a vertex more than once.
    """
    rows = [corners[offsets[face] : offsets[face + 1]] for face in repeated.tolist()]
    if all(len(row) == _QUAD and row[2] == row[3] and len(set(row.tolist())) == _QUAD - 1 for row in rows):
        return " [a, b, c, c] for a triangle: leave out the last one, as torchfair.repair_mesh does."
    return of_sizes(offsets)


def of_numbers(outside: Ints) -> str:
    """A hint where all vertex numbers that do not exist are -1, as padding; else empty.

    Args:
        outside: numbers that are not those of a vertex, at least one.
    """
    if (outside != -1).any():
        return ""
    return " -1 behind the last corner, as in [a, b, c, -1], is padding: leave it out."
