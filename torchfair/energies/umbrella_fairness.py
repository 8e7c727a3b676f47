"""Umbrella fairness: squared umbrella vectors."""

from __future__ import annotations

from typing import ClassVar

from torch import Tensor

from .._loading import safe_to_load
from ..geometry import umbrella_vectors
from ..topology import Topology
from .base import MeshModule


def umbrella_fairness_per_vertex(vertices: Tensor, topology: Topology) -> Tensor:
    """Squared length of the umbrella vector of every vertex, 0 at boundary and isolated vertices: (*batch, V).

    Arguments and errors as for :func:`umbrella_fairness`.

    Example:
        >>> from torchfair.energies import umbrella_fairness_per_vertex
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> umbrella_fairness_per_vertex(mesh.vertices, mesh.topology).shape
        torch.Size([144])
    """
    return umbrella_vectors(vertices, topology).square().sum(-1)


def umbrella_fairness(vertices: Tensor, topology: Topology) -> Tensor:
    """Umbrella fairness ``sum_v |u_v|^2`` over the interior vertices (paper section 5.3, Kobbelt et al. 1998).

    ``u_v`` is the mean of the neighbours of ``v`` minus ``v``: each star counts once, whatever its valence
    and area. It punishes uneven spacing as well as bending, pulls vertices together, and goes to 0 like h^2
    when a mesh of a fixed surface is refined regularly to edge length h.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch,) >= 0, unit length^2, unchanged by rigid motions: whole squares; the weight of
        :func:`~torchfair.constraints.interior_fairness_terms` counts half. A quadratic polynomial, smooth everywhere;
        boundary and isolated vertices contribute nothing, degenerate faces are of no consequence.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.energies import umbrella_fairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> umbrella_fairness(mesh.vertices, mesh.topology)
        tensor(0.0721, dtype=torch.float64)
    """
    return topology.sum_per_mesh(umbrella_fairness_per_vertex(vertices, topology), "vertices")


@safe_to_load
class UmbrellaFairness(MeshModule):
    """Module form of :func:`umbrella_fairness`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Example:
        >>> from torchfair.energies import UmbrellaFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> energy = UmbrellaFairness(mesh.topology)
        >>> energy(mesh.vertices)
        tensor(0.0721, dtype=torch.float64)
        >>> batch = mesh.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    needs: ClassVar[tuple[str, ...]] = ("is_boundary_vertex", "valences")

    def per_vertex(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, V); see :func:`umbrella_fairness_per_vertex`."""
        return umbrella_fairness_per_vertex(vertices, self.topology)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Energy (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_vertex(vertices), "vertices")
