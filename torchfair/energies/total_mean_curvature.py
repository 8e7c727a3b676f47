"""Total mean curvature: edge lengths times signed dihedral angles."""

from __future__ import annotations

from torch import Tensor

from .._loading import safe_to_load
from ..topology import Topology
from .angle_variation import lengths_times_angles
from .base import EdgeEnergy, weigh


def total_mean_curvature_per_edge(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    """Terms ``l a / 2`` of the total mean curvature for every interior edge, times its weight: (*batch, I).

    Arguments, degenerate cases and errors as for :func:`total_mean_curvature`.

    Example:
        >>> from torchfair.energies import total_mean_curvature_per_edge
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> total_mean_curvature_per_edge(mesh.vertices, mesh.topology).shape
        torch.Size([240])
    """
    return weigh(lengths_times_angles(vertices, topology) / 2, edge_weights, topology)


def total_mean_curvature(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    """Total mean curvature ``1/2 sum_e l_e a_e`` over the interior edges (paper section 1.2).

    ``l`` is the length and ``a`` the signed dihedral angle, positive where convex. It discretises the
    integral of ``(k1 + k2)/2`` for any well-shaped mesh of a surface (Cohen-Steiner and Morvan): 4 pi R on
    a sphere. Turning all faces round changes its sign.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        edge_weights: (I,) or (*batch, I) factors of the terms, 1 if left out.

    Returns:
        (*batch,) of any sign, same unit as the vertices; scales with them, unchanged by rigid motions.
        Smooth at flat edges. Edges of length zero, on the boundary or beside a degenerate face (see
        :func:`torchfair.geometry.face_normals`) contribute nothing, with zero derivatives.

    Raises:
        ShapeError: if ``vertices`` or ``edge_weights`` has the wrong shape or is not floating.

    Example:
        >>> from torchfair.energies import total_mean_curvature
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> total_mean_curvature(ball.vertices, ball.topology)  # nearly 8 pi, that of the sphere of radius 2
        tensor(24.9744, dtype=torch.float64)
    """
    return topology.sum_per_mesh(total_mean_curvature_per_edge(vertices, topology, edge_weights), "interior_edges")


@safe_to_load
class TotalMeanCurvature(EdgeEnergy):
    """Module form of :func:`total_mean_curvature`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Example:
        >>> from torchfair.energies import TotalMeanCurvature
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> energy = TotalMeanCurvature(ball.topology)
        >>> energy(ball.vertices)  # nearly 8 pi, that of the sphere of radius 2
        tensor(24.9744, dtype=torch.float64)
        >>> batch = ball.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I), weights included; see :func:`total_mean_curvature_per_edge`."""
        return total_mean_curvature_per_edge(vertices, self.topology, self.edge_weights)
