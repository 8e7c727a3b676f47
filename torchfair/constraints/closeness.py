"""Vertices stay near a reference surface (paper section 5.1: tangent planes, refreshed as iteration goes on)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ..geometry.closest_point import ReferenceSurface
from ..projection import ElementTerm
from ..projection.layout import State
from .barrier import barrier, barrier_slope

Feet = Callable[[State], tuple[Tensor, Tensor]]  # closest points (V, 3) and unit normals (V, 3)


class TangentPlanes:
    """Closest points on a reference surface and the normals of the planes that stand for it there.

    The normal points from the closest point to the vertex where they differ, so that the distance to the
    plane, its gradient and the true distance agree; on the surface it is the interpolated vertex normal.
    The last answer is kept for the very tensor that was asked about, since several terms ask for the same state.
    """

    def __init__(self, reference: ReferenceSurface, block: str = "vertices") -> None:
        self.reference, self.block = reference, block
        self._tracker = reference.tracker()
        self._asked: tuple[Tensor, int] | None = None
        self._answer: tuple[Tensor, Tensor] | None = None

    def __call__(self, state: State) -> tuple[Tensor, Tensor]:
        """Closest points ``(V, 3)`` and unit normals ``(V, 3)`` for all vertices of the state."""
        points = state[self.block]
        if self._answer is not None and self._is_last(points):
            return self._answer
        closest = self._tracker.closest(points)
        away = points - closest.positions
        distance = closest.distances[:, None]
        smooth = closest.smooth_normals
        side = torch.where((away * smooth).sum(1, keepdim=True) < 0.0, -1.0, 1.0).to(points.dtype)
        far = distance > 1e-9
        normals = torch.where(far, side * away / torch.where(far, distance, torch.ones_like(distance)), smooth)
        self._asked = None if points.is_inference() else (points, points._version)
        self._answer = closest.positions, normals
        return self._answer

    def _is_last(self, points: Tensor) -> bool:
        """Whether these are the very points asked for last; comparing their values would wait for other devices."""
        return self._asked is not None and points is self._asked[0] and points._version == self._asked[1]


def plane_distances(x: Tensor, feet: Tensor, normals: Tensor) -> Tensor:
    """(n,) signed distances of vertices ``x`` (n, 1, 3) from the planes through ``feet``, all at once."""
    return ((x[:, 0] - feet) * normals).sum(1)


def plane_normals(x: Tensor, feet: Tensor, normals: Tensor) -> Tensor:
    """(n, 3) their derivatives."""
    return normals


def closeness_terms(planes: Feet, vertices: Tensor, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Distance of ``vertices`` (n,) from the reference surface, in their unit; ``planes`` are those of all vertices."""

    def refresh(state: State) -> tuple[Tensor, ...]:
        return tuple(part[vertices] for part in planes(state))

    stencil = [(block, vertices[:, None])]
    return [
        ElementTerm(
            "closeness",
            plane_distances,
            stencil,
            weight=weight,
            refresh=refresh,
            jacobian=plane_normals,
            batched=True,
        )
    ]


def distance_limit_terms(planes: Feet, limits: Tensor, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Barrier that no vertex crosses: ``limits`` (V,) are the largest distances allowed; silent below half of it.

    The limits are on the device of the vertices.
    """

    def limit(x: Tensor, feet: Tensor, normals: Tensor, most: Tensor) -> Tensor:
        return barrier(most - plane_distances(x, feet, normals).abs(), 0.5 * most)

    def slope(x: Tensor, feet: Tensor, normals: Tensor, most: Tensor) -> Tensor:
        distances = plane_distances(x, feet, normals)
        return (-distances.sign() * barrier_slope(most - distances.abs(), 0.5 * most))[:, None] * normals

    def refresh(state: State) -> tuple[Tensor, Tensor, Tensor]:
        return (*planes(state), limits)

    stencil = [(block, torch.arange(limits.shape[0], device=limits.device)[:, None])]
    return [ElementTerm("distance limit", limit, stencil, weight=weight, refresh=refresh, jacobian=slope, batched=True)]
