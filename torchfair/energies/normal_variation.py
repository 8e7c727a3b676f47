"""Normal variation E: edge lengths times dual edge lengths."""

from __future__ import annotations

from torch import Tensor

from ..topology import Topology
from ._normal_variation_function import fast_normal_variation, fast_path_serves, plain_terms
from .base import EdgeEnergy, check_edge_weights, weigh


def normal_variation_per_edge(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    """Terms ``l l*`` of E for every interior edge, times its weight: (*batch, I).

    Arguments, degenerate cases and errors as for :func:`normal_variation`.
    """
    return weigh(plain_terms(vertices, topology), edge_weights, topology)


def normal_variation(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    topology.check_vertices(vertices)
    check_edge_weights(edge_weights, topology)
    if not fast_path_serves():
        return normal_variation_per_edge(vertices, topology, edge_weights).sum(-1)
    if edge_weights is not None:
        edge_weights = edge_weights.to(vertices.dtype)
    return fast_normal_variation(vertices, edge_weights, topology)


class NormalVariation(EdgeEnergy):
    """Module form of :func:`normal_variation`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,)."""

    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I), weights included; see :func:`normal_variation_per_edge`."""
        return normal_variation_per_edge(vertices, self.topology, self.edge_weights)

    def forward(self, vertices: Tensor) -> Tensor:
        """E (*batch,) of ``vertices`` (*batch, V, 3)."""
        return normal_variation(vertices, self.topology, self.edge_weights)
