"""A surface in the place that its own shape says, so that where it lay decides nothing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np
import torch

from ..fields import Directions
from ..fields.frames import Complexes, Floats, Ints
from ..geometry import ReferenceSurface
from ..topology import Topology
from .numbering import TIE

_GRID = 2.0**-30
_COARSE = 2.0**-20  # of the largest curvature: fits are less exact than coordinates
_THIN = 2.0**10  # times the grid: with lower triangles coordinates are not rounded


@overload
def rounded(values: Floats, grid: float = _GRID) -> Floats: ...


@overload
def rounded(values: Complexes, grid: float = _GRID) -> Complexes: ...


def rounded(values: Any, grid: float = _GRID) -> Any:
    """Values as whole multiples."""
    return np.rint(values / grid) * grid


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion and a scale that bring a surface to the same place and size, wherever it was.

    Where a surface has symmetries, or is flat, ways to mesh it are equally good, and rounding errors would choose among
    them: another one after a rotation. So the pose follows from the shape, and what is meshed in it is rounded to 30
    bits (curvatures to 20), far above rounding errors and far below what meshes are accurate to.

    Attributes:
        given: (V, 3) vertices where they were.
        triangles: (F, 3).
        placed: (V, 3) where they are in the pose, within one of the origin.
        axes: (3, 3) rows are the axes of the pose.
        origin: (3,) of the pose.
        size: of one unit of the pose.
    """

    given: Floats
    triangles: Ints
    placed: Floats
    axes: Floats
    origin: Floats
    size: float

    @classmethod
    def of(cls, points: Floats, triangles: Ints) -> Pose:
        """The pose with the centroid at the origin and the first vertex on the first axis.

        The second axis is towards the vertex that is farthest from the first one, of several the first.

        Args:
            points: (V, 3), numbered by geometry, so that the first is far from the centroid.
            triangles: (F, 3).
        """
        corners = points[triangles]
        doubled = _lengths(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        origin = (doubled[:, None] * corners.mean(1)).sum(0) / doubled.sum()
        size = float(_lengths(points - origin).max())
        apart = (points - origin) / size
        first = apart[0] / _lengths(apart[0])
        beside = apart - (apart * first).sum(1, keepdims=True) * first
        off = _lengths(beside)
        second = beside[np.argmax(off > off.max() - min(TIE, off.max() / 2))]
        second = second / _lengths(second)
        second = second - (second * first).sum() * first  # exact where all are near the first axis
        second = second / _lengths(second)
        axes = np.stack([first, second, np.cross(first, second)])
        lowest = (doubled / _lengths(np.roll(corners, -1, 1) - corners).max(1)).min()
        placed = _combined(apart, axes.T)
        rounds = lowest > _THIN * _GRID * size
        return cls(points, triangles, rounded(placed) if rounds else placed, axes, origin, size)

    def back(self, points: Floats) -> Floats:
        """Points (n, 3) on the surface in the pose where they were on the given one, vertices exactly there."""
        if not len(points):
            return points
        closest = self._surface.closest(torch.from_numpy(points))
        lost = (closest.weights.numpy()[..., None] * self._lost[self.triangles[closest.faces.numpy()]]).sum(1)
        return np.asarray(self._moved(points) + lost)

    def _moved(self, points: Floats) -> Floats:
        return _combined(points, self.axes) * self.size + self.origin

    @cached_property
    def _surface(self) -> ReferenceSurface:
        topology = Topology.from_faces(torch.from_numpy(self.triangles), len(self.placed))
        return ReferenceSurface(torch.from_numpy(self.placed), topology)

    @cached_property
    def _lost(self) -> Floats:
        """(V, 3) what was rounded off vertices."""
        return self.given - self._moved(self.placed)

    def directions(self, found: Directions) -> Directions:
        """Directions of the surface in the pose, whose curvatures are over its unit."""
        values, means = found.at_corners * self.size, found.means * self.size
        grid = _COARSE * 2.0 ** np.ceil(np.log2(max(np.abs(values).max(), np.abs(means).max(), 1.0)))
        return Directions(rounded(values, grid), rounded(means, grid), rounded(found.confidence))

    def length(self, given: float) -> float:
        """A length in the unit of the pose, to 30 bits."""
        share, power = np.frexp(given / self.size)
        return float(np.ldexp(rounded(np.asarray(share)), power))


def _lengths(vectors: Floats) -> Floats:
    return np.asarray(np.sqrt((vectors**2).sum(-1)))


def _combined(points: Floats, axes: Floats) -> Floats:
    """``points @ axes``, each number by itself: products of libraries round as arrays happen to lie in memory."""
    return np.asarray(points[:, :1] * axes[0] + points[:, 1:2] * axes[1] + points[:, 2:] * axes[2])
