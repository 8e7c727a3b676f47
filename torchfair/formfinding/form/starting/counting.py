"""Even triangles, as many as asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....curves import ClosedCurve
from .patch import Floats, Patch
from .plans import Sizes
from .remeshing import Sides, Surface, remeshed

_ROUNDS, _MORE_ROUNDS, _CORRECTIONS = 8, 4, 4
_NEAR = 0.04  # relative: then the size is not corrected any more


def with_so_many(
    patch: Patch, curves: Sequence[ClosedCurve], count: int, sizes: tuple[float, Floats, Floats], right: Sides,
    surface: Surface, *, keeps_rim: bool = False,
) -> Patch:  # fmt: skip
    """A patch with even triangles and about ``count`` vertices.

    Args:
        patch: Triangles.
        curves: On which boundary vertices lie.
        count: Wanted.
        sizes: What :class:`Sizes` is made of; its size is corrected until the number of vertices is right.
        right: See :func:`remeshed`, as for the rest.
        surface: Puts vertices where they belong.
        keeps_rim: Whether boundary edges are not split.
    """
    size, places, across = sizes
    rounds = _ROUNDS
    for _ in range(1 + _CORRECTIONS):
        patch = remeshed(patch, curves, Sizes(size, places, across), right, surface, rounds, keeps_rim=keeps_rim)
        ratio = len(patch.points) / count
        if abs(ratio - 1.0) < _NEAR:
            break
        size, rounds = size * ratio**0.5, _MORE_ROUNDS
        across = across * max(ratio, 1.0) ** 0.5  # narrow parts have fewer rows rather than too many vertices
    return patch


def edge_length(area: float, boundary: float, count: int) -> float:
    """Of a mesh of even triangles: ``count = area / (sqrt(3)/2 length^2) + boundary / (2 length)``."""
    density = area * 2 / np.sqrt(3)
    return float((boundary / 2 + np.sqrt(boundary**2 / 4 + 4 * count * density)) / (2 * count))
