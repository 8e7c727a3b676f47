"""Spacings that follow curvature, clamped to a range."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..fields import Directions, FaceFrames
from ..fields.frames import Floats
from .sizes import SizeField

ASKED = ("spacing_shortest", "spacing_longest", "range_share")
"""What reports of meshes say about these spacings."""

_GRADATION = 0.25  # by which the spacing may grow over one edge
_FLATTER = 0.25  # of the larger curvature, below which the smaller one does not lengthen edges any more
_LIMITED = 0.05  # of a spacing by which one is out of the range
_FLATTEST = 1e-3  # of the root mean square curvature, below which places count as flat


class CurvatureSizes(NamedTuple):
    """Spacings that follow curvature.

    Attributes:
        field: of all triangles.
        limited: share of the area where curvature asks for a spacing out of the range, 0 to 1.
    """

    field: SizeField
    limited: float

    def report(self, spacing: float) -> dict[str, float]:
        """The shortest and the longest spacing asked for by the mean one, and the share at the ends of the range."""
        shortest, longest = (spacing * float(np.exp(end)) for end in (self.field.smallest, self.field.largest))
        return dict(zip(ASKED, (shortest, longest, self.limited), strict=True))


def curvature_sizes(
    frames: FaceFrames, directions: Directions, spacing: float, longest: float, isotropic: bool = False
) -> CurvatureSizes:
    r"""Edges across a curvature k with lengths h in proportion to ``1 / sqrt|k|``: all are as far off the surface.

    An edge is ``|k| h^2 / 8`` off. Spacings are clamped to a range, so that as much is clamped at one end as at the
    other, averaged over so long that they grow by a quarter over one edge at most, and scaled to as many cells as with
    the uniform spacing.

    Args:
        frames: of the triangles; nothing is averaged across edges that are not theirs.
        directions: of the triangles.
        spacing: the uniform one.
        longest: the longest spacing over the shortest, at least 1.
        isotropic: whether both spacings are those of the larger curvature.
    """
    width = math.log(longest)
    zero = np.zeros(len(frames.areas))
    if not width:
        return CurvatureSizes(SizeField(zero, zero.astype(complex)), 1.0)
    size = np.abs(directions.values)
    wanted = _wanted(directions.means + size, directions.means - size, frames.areas, isotropic)
    shortest = _range_start(wanted, frames.areas, width)
    kept = np.clip(wanted, shortest, shortest + width)
    axes = directions.values / np.where(size > 0, size, 1.0)
    field = SizeField(kept.mean(0), (kept[0] - kept[1]) / 2 * axes)
    field = field.smoothed(frames, gradation_length(longest) * spacing).counted(frames.areas)
    return CurvatureSizes(field, float(frames.areas @ (np.abs(wanted - kept) > _LIMITED).any(0) / frames.areas.sum()))


def gradation_length(longest: float) -> float:
    """Over how many spacings logarithms are averaged, so that the spacing grows by a quarter over one at most."""
    return math.log(longest) / (2 * math.log1p(_GRADATION))


def _wanted(larger: Floats, smaller: Floats, areas: Floats, isotropic: bool) -> Floats:
    """(2, F) logarithms of spacings along both directions, but for a constant."""
    bends = np.abs(np.stack([larger, smaller]))
    most = bends.max(0)
    scale = math.sqrt((most**2 @ areas) / areas.sum())
    if not scale:
        return np.zeros_like(bends)
    kept = np.stack([most, most]) if isotropic else np.hypot(bends, _FLATTER * most)
    return np.asarray(-np.log(np.hypot(kept / scale, _FLATTEST)) / 2)


def _range_start(logarithms: Floats, areas: Floats, width: float) -> float:
    """Where a range begins that has as much of the area below it as above: it clamps the least."""

    def excess(start: float) -> float:
        return float(((logarithms < start).sum(0) - (logarithms > start + width).sum(0)) @ areas)

    return float(brentq(excess, logarithms.min() - width - 1, logarithms.max() + 1))
