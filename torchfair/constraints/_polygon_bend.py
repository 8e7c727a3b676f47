"""Bending and twist of edges between polygons, and their derivatives in closed form."""

from __future__ import annotations

from functools import cache, partial
from typing import NamedTuple

import torch
from torch import Tensor

from ..projection.term import Residual
from ._components import area_derivatives, area_vectors, components_first, cross, dot


class PolygonBend(NamedTuple):
    """The residual of edges with a left face of a given number of corners, and its Jacobian."""

    residual: Residual
    jacobian: Residual


@cache
def polygon_bend(left_size: int) -> PolygonBend:
    """The same functions every time, so that stages of a job that share a problem find what they know."""
    residual = partial(polygon_pair_bend, left_size=left_size)
    return PolygonBend(residual, partial(polygon_pair_bend_jacobian, left_size=left_size))


def polygon_pair_bend(x: Tensor, left_size: int) -> Tensor:
    """Bending and twist (n, 2) of edges between polygons: vectors of norm ``l l*``.

    ``n - n'`` is orthogonal to ``n + n'``, so two components describe it: one across the edge, signed,
    positive where convex, and one along it, which vanishes for planar faces. Both are smooth at zero.

    Args:
        x: (n, k, 3) the edge, the other corners of its left face after it, those of its right face; one edge (k, 3)
            gives (2,).
        left_size: Corners of the left face.
    """
    frame = _Frame.of(*_faces(components_first(x), left_size))
    return torch.stack([frame.length * frame.bend, frame.length * frame.twist]).transpose(0, -1)


def polygon_pair_bend_jacobian(x: Tensor, left_size: int) -> Tensor:
    """Jacobians (n, 2, 3k) of :func:`polygon_pair_bend`.

    In the frame ``along, across, mean`` of the edge, the jump d = n' - n of the normals changes with them, and the
    frame turns about ``mean`` by ``tau``; so ``d(l d . across) = (d . across) dl + l across . dd - l (d . along) tau``,
    and ``d(l d . along)`` likewise.
    """
    left, right = _faces(components_first(x), left_size)
    frame = _Frame.of(left, right)
    along, across = frame.along, frame.across
    direction = (left[:, 1] - left[:, 0]) / frame.length
    sideways = frame.length / frame.lying  # of the turn tau with the edge, times l; it turns across itself
    tilt = sideways * frame.rising / frame.opening  # with the sum of the normals
    rows = []
    for part, jump, other in ((frame.bend, across, -frame.twist), (frame.twist, along, frame.bend)):
        at_edge = part * direction + (sideways * other) * across
        by_sum, by_jump = (tilt * other) * across, frame.length * jump
        by_left = area_derivatives(left, _tangential(-by_jump - by_sum, frame.left) / frame.left_area)
        by_right = area_derivatives(right, _tangential(by_jump - by_sum, frame.right) / frame.right_area)
        start, end = by_left[:, 0] + by_right[:, 1] - at_edge, by_left[:, 1] + by_right[:, 0] + at_edge
        rows.append(torch.cat([torch.stack([start, end], 1), by_left[:, 2:], by_right[:, 2:]], 1))
    by_corners = torch.stack(rows).transpose(1, 2).flatten(1, 2)  # (2, 3k, n)
    return by_corners.permute(2, 0, 1) if x.ndim == 3 else by_corners


def _faces(corners: Tensor, left_size: int) -> tuple[Tensor, Tensor]:
    """Corners (3, k, n) of the left face from the start of the edge, and of the right face from its end."""
    return corners[:, :left_size], torch.cat([corners[:, 1:2], corners[:, :1], corners[:, left_size:]], 1)


def _tangential(vectors: Tensor, normals: Tensor) -> Tensor:
    return vectors - dot(vectors, normals) * normals


class _Frame(NamedTuple):
    """Quantities of edges (n,) and vectors (3, n).

    Attributes:
        left, right: Unit normals of the faces.
        left_area, right_area: Their areas.
        along, across: Unit vectors orthogonal to the mean normal, the first in the plane of that and the edge.
        length: Of the edge.
        lying, rising: Its components along ``along`` and along the mean normal.
        opening: Length of the sum of the normals.
        bend, twist: Components of ``right - left`` across and along.
    """

    left: Tensor
    right: Tensor
    left_area: Tensor
    right_area: Tensor
    along: Tensor
    across: Tensor
    length: Tensor
    lying: Tensor
    rising: Tensor
    opening: Tensor
    bend: Tensor
    twist: Tensor

    @classmethod
    def of(cls, left_face: Tensor, right_face: Tensor) -> _Frame:
        """From the corners (3, k, n) of both faces."""
        left, right = area_vectors(left_face), area_vectors(right_face)
        left_area, right_area = dot(left, left).sqrt(), dot(right, right).sqrt()
        left, right = left / left_area, right / right_area
        edge = left_face[:, 1] - left_face[:, 0]
        mean = left + right
        opening = dot(mean, mean).sqrt()
        mean = mean / opening
        rising = dot(edge, mean)
        along = edge - rising * mean
        lying = dot(along, along).sqrt()
        along = along / lying
        across = cross(along, mean)
        jump, length = right - left, dot(edge, edge).sqrt()
        bend, twist = dot(jump, across), dot(jump, along)
        return cls(left, right, left_area, right_area, along, across, length, lying, rising, opening, bend, twist)
