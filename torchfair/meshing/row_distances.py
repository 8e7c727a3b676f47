"""How far apart rows of triangles lie, so that E is low where K is negative."""

from __future__ import annotations

import math

import numpy as np

from ..fields import Directions, FaceFrames
from ..fields.frames import Floats
from .pose import rounded
from .sizes import SizeField

EQUILATERAL = math.sqrt(3) / 2
"""Distance of rows of equilateral triangles over the spacing along them."""

_MOST = 1.4  # distance of rows over the spacing
_FLATTEST = 1e-6  # curvature times the root of the area, below which it is rounding
_EXCESS = 0.15  # of E over C, where K is negative


def rows_across(frames: FaceFrames, directions: Directions) -> bool:
    """Whether rows follow the direction of the smaller curvature (with signs), not of the larger."""
    larger, smaller = _integrals(frames, directions)
    return bool(smaller < larger)


def row_distance(frames: FaceFrames, directions: Directions) -> float:
    """Distance of rows over the spacing: E exceeds C by ``|a| / (2 ratio^2)`` where K is negative."""
    larger, smaller = _integrals(frames, directions)
    total = float(larger + smaller)
    return float(_ratio(rounded(np.array(min(larger, smaller) / total)))) if total > 0 else EQUILATERAL


def row_sizes(
    sizes: SizeField, frames: FaceFrames, directions: Directions, across: bool, ratio: float, spacing: float
) -> SizeField:
    """Sizes with rows as far apart in every place as the curvatures there say, in cells of the same area.

    Args:
        sizes: in which rows have the distance of the lattice.
        frames: of the triangles.
        directions: of the triangles.
        across: whether rows follow the direction of the smaller curvature.
        ratio: distance of rows of the lattice, over the spacing along them.
        spacing: over which ratios are averaged.
    """
    size = np.abs(directions.values)
    curvatures = np.stack([directions.means + size, directions.means - size])
    along, other = curvatures[::-1] if across else curvatures
    total = np.abs(along) + np.abs(other)
    share = np.where(along * other < 0, np.abs(along) / np.where(total > 0, total, 1.0), 0.0)
    apart = np.log(_ratio(share) / ratio) / 2
    to_rows = directions.values / np.where(size > 0, size, 1.0) * (-1 if across else 1)
    change = SizeField(np.zeros(len(apart)), -apart * to_rows).smoothed(frames, spacing)
    return SizeField(sizes.means, sizes.values + change.values)


def _ratio(share: Floats) -> Floats:
    """Distance of rows by the share of the curvature along them in the sum of both."""
    return np.asarray(np.clip(np.sqrt(share / (2 * _EXCESS)), EQUILATERAL, _MOST))


def _integrals(frames: FaceFrames, directions: Directions) -> tuple[Floats, Floats]:
    """Integrals of the sizes of the larger and of the smaller curvature (with signs) over negative K, or over all.

    What is flat but for rounding has none.
    """
    difference = np.abs(directions.values)
    larger, smaller = directions.means + difference, directions.means - difference
    bends = np.abs(larger) + np.abs(smaller) > _FLATTEST / np.sqrt(frames.areas.sum())
    larger, smaller = np.where(bends, larger, 0.0), np.where(bends, smaller, 0.0)
    saddle = larger * smaller < 0
    where = frames.areas * (saddle if saddle.any() else True)
    return np.asarray(where @ np.abs(larger)), np.asarray(where @ np.abs(smaller))
