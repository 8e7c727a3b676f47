"""Faces stay well shaped: barriers on corner angles and face areas."""

from __future__ import annotations

import torch
from torch import Tensor

from ..projection import ElementTerm
from ..topology import Topology
from ._components import area_derivatives, area_vectors, components_first, cross, derivative_rows, dot, lengths
from .barrier import barrier, barrier_slope

_TINY = 1e-30  # of the squared lengths of vectors: for those that are zero


def corner_angle_terms(
    topology: Topology, smallest: float, safe: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Barrier that no corner angle crosses.

    Args:
        topology: Any polygon mesh.
        smallest: Bound in radians.
        safe: (H,) angle of each corner from which on the barrier is silent, in radians, above ``smallest``.
        weight: Dimensionless.
        block: Name of the vertex block.
    """

    def angle(x: Tensor, silent: Tensor) -> Tensor:
        ahead, back = _legs(x)
        return barrier(_angles(ahead, back, lengths(cross(ahead, back))) - smallest, silent - smallest)

    def slope(x: Tensor, silent: Tensor) -> Tensor:
        ahead, back = _legs(x)
        normal = cross(ahead, back)
        length = lengths(normal)
        normal = normal / torch.where(length > 0.0, length, 1.0)  # a closed corner opens to no side more than another
        steepness = barrier_slope(_angles(ahead, back, length) - smallest, silent - smallest)
        at_ahead = steepness / dot(ahead, ahead) * cross(ahead, normal)
        at_back = steepness / dot(back, back) * cross(normal, back)
        return derivative_rows([at_back, -(at_ahead + at_back), at_ahead])

    stencil = [(block, corner_stencil(topology))]
    return [ElementTerm("corner angles", angle, stencil, data=(safe,), weight=weight, jacobian=slope, batched=True)]


def _legs(x: Tensor) -> tuple[Tensor, Tensor]:
    """(3, n) edges ahead and back from the corners ``x[:, 1]``."""
    corners = components_first(x)
    return corners[:, 2] - corners[:, 1], corners[:, 0] - corners[:, 1]


def _angles(ahead: Tensor, back: Tensor, sines: Tensor) -> Tensor:
    """(n,) angles between legs, in [0, pi]; ``sines`` are the lengths of their cross products."""
    return torch.atan2(sines, dot(ahead, back))


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
    """Barrier that keeps every face above the fraction ``smallest`` of its own area in ``areas`` (F,)."""

    def share(x: Tensor, area: Tensor) -> Tensor:
        margin = lengths(area_vectors(components_first(x))) / area - smallest
        return barrier(margin, torch.full_like(margin, safe - smallest))

    def slope(x: Tensor, area: Tensor) -> Tensor:
        corners = components_first(x)
        vectors = area_vectors(corners)
        sizes = lengths(vectors)
        margin = sizes / area - smallest
        steepness = barrier_slope(margin, torch.full_like(margin, safe - smallest)) / area
        return derivative_rows(area_derivatives(corners, steepness / sizes.clamp_min(_TINY) * vectors).unbind(1))

    return [
        ElementTerm(
            "face areas", share, [(block, corners)], data=(areas[numbers],), weight=weight, jacobian=slope, batched=True
        )
        for numbers, corners in topology.faces_by_size.values()
    ]
