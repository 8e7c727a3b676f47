"""Angle variation E': edge lengths times dihedral angles."""

from __future__ import annotations

from torch import Tensor

from .._loading import safe_to_load
from .._precision import in_single_at_least
from .._remembered import remembered
from ..geometry import dihedral_angles, edge_lengths
from ..geometry._unit import in_their_units
from ..topology import Topology
from .base import EdgeEnergy, weigh


@remembered
@in_single_at_least
def lengths_times_angles(vertices: Tensor, topology: Topology) -> Tensor:
    """Length times signed dihedral angle (*batch, I) of every interior edge, for meshes of any size."""
    topology.check_vertices(vertices)
    vertices, unit = in_their_units(vertices, topology, "interior_edges")
    lengths = edge_lengths(vertices, topology)[..., : topology.num_interior_edges]
    return lengths * dihedral_angles(vertices, topology) * unit


def angle_variation_per_edge(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    """Terms ``l |a|`` of E' for every interior edge, times its weight: (*batch, I).

    Arguments, degenerate cases and errors as for :func:`angle_variation`.

    Example:
        >>> from torchfair.energies import angle_variation_per_edge
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> angle_variation_per_edge(mesh.vertices, mesh.topology).shape
        torch.Size([240])
    """
    return weigh(lengths_times_angles(vertices, topology).abs(), edge_weights, topology)


def angle_variation(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    """Angle variation ``E' = sum_e l_e |a_e|`` over the interior edges (paper section 3).

    ``l`` is the length and ``a`` the angle between the normals of the faces beside the edge. E' is close to
    the normal variation E for small angles and at most pi/2 times it. Convex polytopes have twice their total mean
    curvature, however their faces are triangulated. Under refinement E' need not converge to a curvature
    integral of the surface: that depends on the layout of the edges, which is its use.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        edge_weights: (I,) or (*batch, I) factors of the terms, 1 if left out.

    Returns:
        (*batch,) >= 0, same unit as the vertices; scales with them, unchanged by rigid motions. At flat
        edges there is a kink with value 0, and the derivative given is 0, a subgradient. Edges of length
        zero, on the boundary or beside a degenerate face (see :func:`torchfair.geometry.face_normals`)
        contribute nothing, with zero derivatives.

    Raises:
        ShapeError: if ``vertices`` or ``edge_weights`` has the wrong shape or is not floating.

    Example:
        >>> from torchfair.energies import angle_variation
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> angle_variation(mesh.vertices, mesh.topology)
        tensor(23.4003, dtype=torch.float64)
    """
    return topology.sum_per_mesh(angle_variation_per_edge(vertices, topology, edge_weights), "interior_edges")


@safe_to_load
class AngleVariation(EdgeEnergy):
    """Module form of :func:`angle_variation`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Example:
        >>> from torchfair.energies import AngleVariation
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> energy = AngleVariation(mesh.topology)
        >>> energy(mesh.vertices)
        tensor(23.4003, dtype=torch.float64)
        >>> batch = mesh.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I), weights included; see :func:`angle_variation_per_edge`."""
        return angle_variation_per_edge(vertices, self.topology, self.edge_weights)
