"""Faces stay well shaped: barriers on corner angles and face areas."""

from __future__ import annotations

from functools import partial

import torch
from torch import Tensor

from ..geometry._ops import angle_of
from ..projection import ElementTerm
from ..topology import Topology
from ._components import area_derivatives, area_vectors, components_first, cross, derivative_rows, dot, lengths
from ._pooled import pooled_faces
from .barrier import barrier, barrier_slope
from .base import Constraint

_TINY = 1e-30  # of the squared lengths of vectors: for those that are zero


def corner_angle_terms(
    topology: Topology, smallest: float, safe: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Barrier that no corner angle crosses.

    Args:
        topology: Any polygon mesh.
        smallest: Bound in radians.
        safe: (H,) angle of each corner from which on the barrier is silent, in radians, above ``smallest``.
        weight: Of half the squared barrier; dimensionless.
        block: Name of the vertex block.
    """
    angle, slope = partial(angle_barrier, smallest=smallest), partial(angle_barrier_slope, smallest=smallest)
    stencil = [(block, corner_stencil(topology))]
    return [
        ElementTerm(
            "corner angles", angle, stencil, data=(safe,), weight=weight, jacobian=slope, silent=True, batched=True
        )
    ]


def _legs(x: Tensor) -> tuple[Tensor, Tensor]:
    """(3, n) edges ahead and back from the corners ``x[:, 1]``."""
    corners = components_first(x)
    return corners[:, 2] - corners[:, 1], corners[:, 0] - corners[:, 1]


def _angles(ahead: Tensor, back: Tensor, sines: Tensor) -> Tensor:
    """(n,) angles between legs, in [0, pi]; ``sines`` are the lengths of their cross products."""
    return angle_of(sines, dot(ahead, back))


def angle_barrier(x: Tensor, safe: Tensor, *, smallest: float) -> Tensor:
    """Barriers (n,) at angles ``smallest`` of corners ``x`` (n, 3, 3), silent from ``safe`` (n,) on."""
    ahead, back = _legs(x)
    return barrier(_angles(ahead, back, lengths(cross(ahead, back))) - smallest, safe - smallest)


def angle_barrier_slope(x: Tensor, safe: Tensor, *, smallest: float) -> Tensor:
    """Jacobians (n, 9) of :func:`angle_barrier`."""
    ahead, back = _legs(x)
    normal = cross(ahead, back)
    length = lengths(normal)
    normal = normal / torch.where(length > 0.0, length, 1.0)  # a closed corner opens to no side more than another
    steepness = barrier_slope(_angles(ahead, back, length) - smallest, safe - smallest)
    at_ahead = steepness / dot(ahead, ahead) * cross(ahead, normal)
    at_back = steepness / dot(back, back) * cross(normal, back)
    return derivative_rows([at_back, -(at_ahead + at_back), at_ahead])


def corner_stencil(topology: Topology) -> Tensor:
    """(H, 3) previous vertex, vertex and next vertex of every face corner."""
    following = topology.next_corners
    previous = torch.empty_like(following)
    previous[following] = torch.arange(following.shape[0], device=topology.device)
    return torch.stack([topology.corners[previous], topology.corners, topology.corners[following]], dim=1)


def face_area_terms(
    topology: Topology,
    areas: Tensor,
    *,
    smallest: float = 0.2,
    safe: float = 0.5,
    weight: float,
    block: str = "vertices",
) -> list[ElementTerm]:
    """Barrier that keeps every face above the fraction ``smallest`` of its own area in ``areas`` (F,).

    The weight multiplies half the squared barrier.
    """
    share = partial(area_barrier, smallest=smallest, safe=safe)
    slope = partial(area_barrier_slope, smallest=smallest, safe=safe)
    return [
        ElementTerm(
            "face areas",
            group.function(share),
            [(block, group.stencil)],
            data=(areas[group.numbers], *group.data),
            weight=weight,
            jacobian=group.jacobian(slope),
            silent=True,
            batched=True,
        )
        for group in pooled_faces(topology)
    ]


def area_barrier(x: Tensor, area: Tensor, *, smallest: float, safe: float) -> Tensor:
    """Barriers (n,) at the fraction ``smallest`` of ``area`` (n,) of faces ``x`` (n, k, 3), silent from ``safe`` on."""
    margin = lengths(area_vectors(components_first(x))) / area - smallest
    return barrier(margin, torch.full_like(margin, safe - smallest))


def area_barrier_slope(x: Tensor, area: Tensor, *, smallest: float, safe: float) -> Tensor:
    """Jacobians (n, 3k) of :func:`area_barrier`."""
    corners = components_first(x)
    vectors = area_vectors(corners)
    sizes = lengths(vectors)
    margin = sizes / area - smallest
    steepness = barrier_slope(margin, torch.full_like(margin, safe - smallest)) / area
    return derivative_rows(area_derivatives(corners, steepness / sizes.clamp_min(_TINY) * vectors).unbind(1))


class CornerAngles(Constraint):
    """Module form of :func:`corner_angle_terms`: half the sum of squared barriers, dimensionless.

    Zero where all angles are above ``safe``, infinite where one is below ``smallest``; unchanged by similarities.

    Args:
        topology: Any polygon mesh.
        smallest: Bound in radians.
        safe: (H,) angle of each corner from which on the barrier is silent, in radians, above ``smallest``.

    Example:
        >>> import torch
        >>> from torchfair.constraints import CornerAngles
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> constraint = CornerAngles(mesh.topology, 0.1, torch.full((len(mesh.topology.corners),), 0.2).double())
        >>> constraint(mesh.vertices)
        tensor(0., dtype=torch.float64)
    """

    def __init__(self, topology: Topology, smallest: float, safe: Tensor) -> None:
        super().__init__(corner_angle_terms(topology, smallest, safe, weight=1.0))


class FaceAreas(Constraint):
    """Module form of :func:`face_area_terms`: half the sum of squared barriers, dimensionless.

    Zero where all faces have more than the fraction ``safe`` of their area, infinite where one has less than
    ``smallest``; unchanged by rigid motions.

    Args:
        topology: Any polygon mesh.
        areas: (F,) what shares are of, above 0.
        smallest: Share that no face goes below.
        safe: Share from which on the barrier is silent.

    Example:
        >>> import torch
        >>> from torchfair.constraints import FaceAreas
        >>> from torchfair.geometry import face_areas
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = FaceAreas(mesh.topology, face_areas(mesh.vertices, mesh.topology))
        >>> constraint(mesh.vertices)
        tensor(0., dtype=torch.float64)
    """

    def __init__(self, topology: Topology, areas: Tensor, *, smallest: float = 0.2, safe: float = 0.5) -> None:
        super().__init__(face_area_terms(topology, areas, smallest=smallest, safe=safe, weight=1.0))
