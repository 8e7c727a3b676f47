"""Closest points of a reference mesh as differentiable functions of its vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from ... import constraints as c
from ...geometry import ReferenceSurface
from ...geometry._ops import cross, dot
from ...projection.layout import State

_ON_EDGE = 1e-12  # barycentric coordinate of corners that count for nothing
_APART = 1e-9  # distance from which on the normal is the direction to the vertex


class TracedPlanes:
    """What :class:`~torchfair.constraints.TangentPlanes` finds, with derivatives for the vertices of the reference.

    For given points they are exact as long as closest points stay on their faces, edges or vertices: there the foot is
    that of the perpendicular onto a plane or a line, or a vertex. With a kink between them, as the distance itself.

    Args:
        surface: The reference.
        vertices: (R, 3) its vertices, as they are there, with what they are functions of.
        block: Name of the block of points.
    """

    def __init__(self, surface: ReferenceSurface, vertices: Tensor, block: str = "vertices") -> None:
        self._surface, self._found = surface, c.TangentPlanes(surface, block)
        self._points, self._block = torch.cat([vertices, _centres(surface, vertices)]), block

    def __call__(self, state: State) -> tuple[Tensor, Tensor]:
        """Closest points ``(V, 3)`` and unit normals ``(V, 3)`` for all vertices of the state."""
        points = state[self._block].detach()
        _, smooth = self._found({self._block: points})
        closest = self._surface.closest(points)
        feet = _feet(points, self._points[self._surface.pieces[closest.pieces]], closest.weights > _ON_EDGE)
        away = points - feet
        far = closest.distances[:, None] > _APART
        length = torch.linalg.vector_norm(torch.where(far, away, 1.0), dim=1, keepdim=True)
        side = torch.where((away.detach() * smooth).sum(1, keepdim=True) < 0.0, -1.0, 1.0)
        return feet, torch.where(far, side * away / length, smooth)


def _centres(surface: ReferenceSurface, vertices: Tensor) -> Tensor:
    """(P - R, 3) centres of the faces that the surface cuts into fans, means of their corners."""
    count = surface.points.shape[0] - vertices.shape[0]
    sums, numbers = vertices.new_zeros(count, 3), vertices.new_zeros(count, 1)
    in_fan = surface.pieces[:, 2] >= vertices.shape[0]
    centre, corner = surface.pieces[in_fan, 2] - vertices.shape[0], surface.pieces[in_fan, 0]
    ones = vertices.new_ones(corner.shape[0], 1)
    return sums.index_add(0, centre, vertices[corner]) / numbers.index_add(0, centre, ones).clamp_min(1.0)


def _feet(points: Tensor, corners: Tensor, counts: Tensor) -> Tensor:
    """(N, 3) feet of perpendiculars from points onto the plane, line or point through those ``corners`` that count.

    Args:
        points: (N, 3).
        corners: (N, 3, 3) of triangles.
        counts: (N, 3) bool, for each of them whether the foot depends on it.
    """
    order = counts.to(torch.int8).argsort(dim=1, descending=True, stable=True)
    a, b, d = corners.gather(1, order[:, :, None].expand_as(corners)).unbind(1)
    along, number = b - a, counts.sum(1)[:, None]
    normal = cross(along, d - a)
    to = points - a
    on_line = a + (dot(to, along) / _positive(dot(along, along)))[:, None] * along
    on_plane = points - (dot(to, normal) / _positive(dot(normal, normal)))[:, None] * normal
    return torch.where(number == 1, a, torch.where(number == 2, on_line, on_plane))


def _positive(squares: Tensor) -> Tensor:
    """Squares, or 1 where they vanish: nothing is divided by them there."""
    return torch.where(squares > 0.0, squares, 1.0)
