"""Stencils of vertex stars: the vertex first, then its ring counterclockwise."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology


def closed_star_stencils(topology: Topology) -> list[Tensor]:
    """Stars of all interior vertices, ``(n, k + 1)`` for every valence k."""
    return [torch.cat([centres[:, None], ring], dim=1) for centres, ring in topology.rings_by_valence.values()]


def by_vertices(by_spokes: Tensor) -> Tensor:
    """Derivatives (..., k, 3) by the spokes of stars as derivatives (..., 3 + 3k) by vertex and ring."""
    return torch.cat([-by_spokes.sum(-2, keepdim=True), by_spokes], dim=-2).flatten(-2)


def open_star_stencils(topology: Topology, vertices: Tensor) -> list[tuple[Tensor, Tensor]]:
    """Stars of boundary ``vertices`` (N,), whose rings run from one boundary edge to the other.

    Returns:
        For every valence k the places (n,) in ``vertices``, and the stars ``(n, k + 1)``.
    """
    valences = topology.valences[vertices]
    stars = []
    for valence in torch.unique(valences).tolist():
        chosen = torch.nonzero(valences == valence).squeeze(1)
        ring = topology.ring_offsets[vertices[chosen], None] + torch.arange(valence, device=topology.device)
        stars.append((chosen, torch.cat([vertices[chosen, None], topology.ring_vertices[ring]], dim=1)))
    return stars
