"""Edges keep their directions within the surface."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry import vertex_normals
from ..geometry._ops import cross, unit
from ..projection import ElementTerm
from ..topology import Topology
from .base import Constraint


def sideways(x: Tensor, across: Tensor) -> Tensor:
    """(1,) how far the end of an edge ``x`` (2, 3) is beside its start, along the unit vector ``across`` (3,)."""
    return ((x[1] - x[0]) * across).sum()[None]


def edge_direction_terms(
    vertices: Tensor,
    topology: Topology,
    edges: Tensor,
    *,
    weight: float,
    along: Tensor | None = None,
    block: str = "vertices",
) -> list[ElementTerm]:
    """How far ``edges`` turn within the surface: sideways components, in the unit of the vertices.

    Sideways is at right angles to the edge and to the surface, both as they are in ``vertices``. Edges may become
    longer or shorter, move along, and bend out of the surface. So a mesh along principal directions stays along them
    while its faces become planar.

    Args:
        vertices: (V, 3) where the edges have the directions that they keep.
        topology: Any polygon mesh.
        edges: (n,) numbers of interior edges, in 0..I-1.
        weight: Of half the squares; dimensionless.
        along: (n, 3) directions that the edges should have in place of those; of any length.
        block: Name of the vertex block.

    Raises:
        MeshError: an edge number is out of range.
    """
    topology.check_interior_edges(edges)
    if not edges.numel():
        return []
    ends = topology.interior_edges[edges]
    if along is None:
        along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    normals = vertex_normals(vertices, topology)[ends].sum(1)
    across = unit(cross(normals, along))
    return [ElementTerm("edge directions", sideways, [(block, ends)], data=(across,), weight=weight, linear=True)]


class EdgeDirections(Constraint):
    """Module form of :func:`edge_direction_terms`: half the sum of the squared sideways components, in length squared.

    At least 0; 0 where no edge has turned within the surface, and for an edge of length 0.

    Args:
        vertices: (V, 3) where the edges have the directions that they keep.
        topology: Any polygon mesh.
        edges: (n,) numbers of interior edges, by default all.

    Example:
        >>> import torch
        >>> from torchfair.constraints import EdgeDirections
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> moved = mesh.vertices + 0.01 * torch.sin(40 * mesh.vertices)
        >>> constraint = EdgeDirections(mesh.vertices, mesh.topology)
        >>> constraint(moved)
        tensor(0.0089, dtype=torch.float64)
    """

    def __init__(self, vertices: Tensor, topology: Topology, edges: Tensor | None = None) -> None:
        every = torch.arange(topology.num_interior_edges, device=vertices.device)
        super().__init__(edge_direction_terms(vertices, topology, every if edges is None else edges, weight=1.0))
