"""Umbrella vectors."""

from __future__ import annotations

import torch
from torch import Tensor

from .._precision import in_single_at_least
from ..topology import Topology
from ._ops import scatter_sum
from .lengths import edge_vectors


@in_single_at_least
def umbrella_vectors(vertices: Tensor, topology: Topology, *, include_boundary: bool = False) -> Tensor:
    r"""Umbrella vector of every vertex: the mean of its neighbours minus the vertex (Kobbelt et al. 1998).

    Neighbours are the ends of all edges at the vertex, boundary edges included::

            w1   w2
              \ /
         w6 -- v -- w3        u_v = 1/6 (w1 + ... + w6) - v
              / \
            w5   w4

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        include_boundary: whether boundary vertices have an umbrella vector too, or the zero vector.

    Returns:
        (*batch, V, 3), same unit. Linear in the vertices. Zero at isolated vertices.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import umbrella_vectors
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> umbrella_vectors(ball.vertices, ball.topology).shape
        torch.Size([162, 3])
    """
    edges = edge_vectors(vertices, topology)
    v, w = topology.edges.unbind(1)
    total = scatter_sum(torch.cat([edges, -edges], dim=-2), torch.cat([v, w]), topology.num_vertices)
    factor = 1 / topology.valences.clamp(min=1).to(vertices.dtype)
    if not include_boundary:
        factor = torch.where(topology.is_boundary_vertex, 0.0, factor)
    return total * factor[:, None]
