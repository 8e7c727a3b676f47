"""Chosen edges stay or become flat."""

from __future__ import annotations

import torch
from torch import Tensor

from .._graph import edge_numbers
from ..projection import ElementTerm
from ..topology import Topology
from .base import Constraint
from .normal_variation import edge_stencils, pair_bend


def flat_edge_terms(topology: Topology, edges: Tensor, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Products ``l l*`` of length and dual length of interior ``edges`` (n,), in the unit of the vertices.

    For edges between triangles that together are one panel, "quads are kept planar via l* = 0 for all diagonals"
    (paper, Fig. 18). Signed, smooth where flat; unlike the distance of the diagonals of a quad, defined for any pair.

    Args:
        topology: Any polygon mesh.
        edges: Numbers of interior edges, in 0..I-1.
        weight: Of half the squares; dimensionless.
        block: Name of the vertex block.

    Raises:
        MeshError: an edge number is out of range.
    """
    topology.check_interior_edges(edges)
    terms = []
    for (left, _), stencil in edge_stencils(topology).items():
        rows = stencil[torch.isin(edge_numbers(topology, stencil[:, :2]), edges)]
        if rows.numel():
            residual, jacobian = pair_bend(left, stencil.shape[1])
            where = [(block, rows)]
            terms.append(ElementTerm("flat edges", residual, where, weight=weight, jacobian=jacobian, batched=True))
    return terms


class FlatEdges(Constraint):
    """Module form of :func:`flat_edge_terms`: half the sum of ``(l l*)^2``, in length squared.

    At least 0, unchanged by rigid motions; 0 exactly where the edges are flat.

    Args:
        topology: Any polygon mesh.
        edges: (n,) numbers of interior edges.

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.constraints import FlatEdges
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> constraint = FlatEdges(topology, torch.tensor([0]))
        >>> constraint(vertices)
        tensor(1.6000)
    """

    def __init__(self, topology: Topology, edges: Tensor) -> None:
        super().__init__(flat_edge_terms(topology, edges, weight=1.0))
