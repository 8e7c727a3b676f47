"""Faces stay well shaped: barriers on corner angles and face areas."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..projection import ElementTerm
from ..topology import Topology
from .barrier import barrier
from .normal_variation import area_vector


def corner_angle(x: Tensor) -> Tensor:
    """Angle at ``x[1]`` between the edges to ``x[0]`` and ``x[2]``, in [0, pi]."""
    back, ahead = x[0] - x[1], x[2] - x[1]
    return torch.atan2(vector_norm(cross(ahead, back)), torch.dot(ahead, back))


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
        return barrier(corner_angle(x) - smallest, silent - smallest)

    return [ElementTerm("corner angles", angle, [(block, corner_stencil(topology))], data=(safe,), weight=weight)]


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
        margin = vector_norm(area_vector(x)) / area - smallest
        return barrier(margin, torch.full_like(margin, safe - smallest))

    return [
        ElementTerm("face areas", share, [(block, corners)], data=(areas[numbers],), weight=weight)
        for numbers, corners in topology.faces_by_size.values()
    ]
