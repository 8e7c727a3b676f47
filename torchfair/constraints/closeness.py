"""Vertices stay near a reference surface (paper section 5.1: tangent planes, refreshed as iteration goes on)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from ..geometry.reference import Reference, closest_on
from ..projection import ElementTerm
from ..projection.layout import State
from ._indexed import IndexedModule
from .barrier import barrier, barrier_slope
from .base import Constraint

Feet = Callable[[State], tuple[Tensor, Tensor]]  # closest points (V, 3) and unit normals (V, 3)


class TangentPlanes:
    """Closest points on a reference surface and the normals of the planes that stand for it there.

    The normal points from the closest point to the vertex where they differ, so that the distance to the
    plane, its gradient and the true distance agree; on the surface it is the interpolated vertex normal.
    Both are constant for derivatives. The last answer is kept for the very tensor that was asked about, since several
    terms ask for the same state; not for tensors that require gradients, which would keep their graph. The reference is
    a mesh, or a function that gives closest points and normals (:func:`torchfair.geometry.closest_on`).
    """

    def __init__(self, reference: Reference, block: str = "vertices") -> None:
        self.reference, self.block = reference, block
        self._closest = closest_on(reference)
        self._asked: tuple[Tensor, int] | None = None
        self._answer: tuple[Tensor, Tensor] | None = None

    def __call__(self, state: State) -> tuple[Tensor, Tensor]:
        """Closest points ``(V, 3)`` and unit normals ``(V, 3)`` for all vertices of the state."""
        points = state[self.block]
        if self._answer is not None and self._is_last(points):
            return self._answer
        asked = None if points.is_inference() or points.requires_grad else (points, points._version)
        points = points.detach()
        positions, smooth = self._closest(points)
        away = points - positions
        distance: Tensor = torch.linalg.vector_norm(away, dim=1, keepdim=True)
        side = torch.where((away * smooth).sum(1, keepdim=True) < 0.0, -1.0, 1.0).to(points.dtype)
        far = distance > 1e-9
        normals = torch.where(far, side * away / torch.where(far, distance, torch.ones_like(distance)), smooth)
        self._asked = asked
        self._answer = positions, normals
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
    """Distance of ``vertices`` (n,) from the reference surface, in their unit; ``planes`` are those of all vertices.

    The weight multiplies half the squared distance.
    """
    stencil = [(block, vertices[:, None])]
    return [
        ElementTerm(
            "closeness",
            plane_distances,
            stencil,
            weight=weight,
            refresh=_ChosenPlanes(planes, vertices),
            jacobian=plane_normals,
            batched=True,
        )
    ]


def distance_limit_terms(planes: Feet, limits: Tensor, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Barrier that no vertex crosses: ``limits`` (V,) are the largest distances allowed; silent below half of it.

    The weight multiplies half the squared barrier. The limits are on the device of the vertices.
    """
    stencil = [(block, torch.arange(limits.shape[0], device=limits.device)[:, None])]
    refresh = _LimitedPlanes(planes, limits)
    return [
        ElementTerm(
            "distance limit",
            limited_distances,
            stencil,
            weight=weight,
            refresh=refresh,
            jacobian=limited_slopes,
            silent=True,
            batched=True,
        )
    ]


def limited_distances(x: Tensor, feet: Tensor, normals: Tensor, most: Tensor) -> Tensor:
    """Barriers (n,) at the distances ``most`` (n,)."""
    return barrier(most - plane_distances(x, feet, normals).abs(), 0.5 * most)


def limited_slopes(x: Tensor, feet: Tensor, normals: Tensor, most: Tensor) -> Tensor:
    """(n, 3) their derivatives."""
    distances = plane_distances(x, feet, normals)
    return (-distances.sign() * barrier_slope(most - distances.abs(), 0.5 * most))[:, None] * normals


class _ChosenPlanes(IndexedModule):
    """Planes of some vertices of a state."""

    def __init__(self, planes: Feet, vertices: Tensor) -> None:
        super().__init__(vertices)
        self.planes = planes
        self._in_order = torch.equal(vertices, torch.arange(len(vertices), device=vertices.device))

    def forward(self, state: State) -> tuple[Tensor, ...]:
        (chosen,), planes = self.indices, self.planes(state)
        if self._in_order and len(chosen) == len(planes[0]):
            return planes  # all of them: no copy
        return tuple(part[chosen] for part in planes)


class _LimitedPlanes(nn.Module):
    """Planes and limits of all vertices of a state."""

    limits: Tensor

    def __init__(self, planes: Feet, limits: Tensor) -> None:
        super().__init__()
        self.planes = planes
        self.register_buffer("limits", limits)

    def forward(self, state: State) -> tuple[Tensor, ...]:
        feet, normals = self.planes(state)
        return feet, normals, self.limits.to(feet.dtype)


class Closeness(Constraint):
    """Module form of :func:`closeness_terms`: half the sum of squared distances from a surface, in length squared.

    Exact are value and gradient, that of half the squared distance, which is the offset from the closest point: the
    closest point is found for every member of a batch and constant for derivatives, and so is the normal of the plane
    there. Second derivatives are therefore those of the planes; the curvature of the surface is left out. Nothing
    flows to the reference.

    The search for closest points runs on the CPU, wherever the vertices are. ``torch.compile`` breaks its graph there.

    Args:
        reference: The surface, a mesh or a function (:func:`torchfair.geometry.closest_on`). It is part of the module
            and not of its ``state_dict``.
        vertices: (n,) numbers of the vertices that are to be near it.

    Example:
        >>> import torch
        >>> from torchfair.constraints import Closeness
        >>> from torchfair.geometry import ReferenceSurface
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> every = torch.arange(len(mesh.vertices))
        >>> moved = mesh.vertices + 0.01 * torch.sin(40 * mesh.vertices)
        >>> constraint = Closeness(ReferenceSurface(mesh.vertices, mesh.topology), every)
        >>> constraint(moved)
        tensor(0.0044, dtype=torch.float64)
    """

    def __init__(self, reference: Reference, vertices: Tensor) -> None:
        super().__init__(closeness_terms(TangentPlanes(reference), vertices, weight=1.0))


class DistanceLimit(Constraint):
    """Module form of :func:`distance_limit_terms`: half the sum of squared barriers, dimensionless.

    Zero where all vertices are within half their limits, infinite where one is beyond. Differentiated as
    :class:`Closeness` is.

    Args:
        reference: The surface, as for :class:`Closeness`.
        limits: (V,) largest distances, above 0; in the state as ``parts.0.refresh.limits``.

    Example:
        >>> import torch
        >>> from torchfair.constraints import DistanceLimit
        >>> from torchfair.geometry import ReferenceSurface
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> limits = torch.full((len(mesh.vertices),), 0.1).double()
        >>> constraint = DistanceLimit(ReferenceSurface(mesh.vertices, mesh.topology), limits)
        >>> constraint(mesh.vertices)
        tensor(0., dtype=torch.float64)
    """

    def __init__(self, reference: Reference, limits: Tensor) -> None:
        super().__init__(distance_limit_terms(TangentPlanes(reference), limits, weight=1.0))
