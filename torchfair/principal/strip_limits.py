"""How far rulings can reach before they meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from torch import Tensor

from .._half_edges import first_few
from ..errors import MeshError
from ._strip_input import StripInput, prepare
from ._unroll import Floats


class StripLimits(NamedTuple):
    """How far strips can reach before rulings meet.

    Attributes:
        height: largest height to the side of the normals, infinite if rulings diverge.
        depth: the same to the other side.
    """

    height: float
    depth: float


def strip_limits(vertices: Tensor, polylines: Sequence[Tensor], normals: Tensor) -> StripLimits:
    """How high and how deep strips can be: where rulings on neighbouring vertices meet, about a radius of curvature.

    Arguments and errors are those of :func:`developable_strips`. Both are 0 if a normal lies along an edge.
    """
    height, depth = _limits(prepare(vertices, polylines, normals)).T
    return StripLimits(float(height.min(initial=math.inf)), float(depth.min(initial=math.inf)))


def _limits(given: StripInput) -> Floats:
    """(n, 2) largest height and depth over each edge: until a corner of the quad is no longer convex."""
    points, unit = given.points, given.normals
    v, w = given.edges.T
    along = points[w] - points[v]
    side = np.cross(along, unit[v] + unit[w])
    least = np.minimum((np.cross(along, unit[v]) * side).sum(1), (np.cross(along, unit[w]) * side).sum(1))
    turn = (np.cross(unit[v], unit[w]) * side).sum(1)
    tiny = 1e-12 * (along**2).sum(1)
    upper, lower = (np.divide(least, rate, out=np.full(len(least), np.inf), where=rate > 0) for rate in (turn, -turn))
    return np.where((least > tiny)[:, None], np.stack([upper, lower], axis=1), 0.0)


def require_clear(given: StripInput, height: float, depth: float) -> None:
    """Raises MeshError if rulings meet, with the heights at which they do not."""
    limits = _limits(given)
    for rows, fault in (
        (limits[:, 0] == 0, "have no length or a normal along them"),
        (
            (limits[:, 0] <= height) | (limits[:, 1] <= depth),
            "carry rulings that meet within the strip. A height below {:.6g} and a depth below {:.6g} will do",
        ),
    ):
        if rows.any():
            wrong = [f"({v}, {w})" for v, w in given.edges[rows].tolist()]
            words = fault.format(*limits.min(0))
            raise MeshError(f"{len(wrong)} edge(s) of the polylines, {first_few(wrong, len(wrong))}, {words}.")
