"""Polyline fairness: squared second differences along mesh polylines."""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor

from .._loading import safe_to_load
from ..errors import MeshError
from ..geometry import second_differences
from ..geometry.polylines import check_triples
from ..polylines import straight_triples
from ..topology import Topology
from .base import MeshModule, Reduction


def polyline_fairness_per_triple(vertices: Tensor, topology: Topology, triples: Tensor | None = None) -> Tensor:
    """Squared second difference of every triple: (*batch, N).

    Arguments and errors as for :func:`polyline_fairness`.

    Example:
        >>> from torchfair.energies import polyline_fairness_per_triple
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> polyline_fairness_per_triple(mesh.vertices, mesh.topology).shape
        torch.Size([256])
    """
    topology.check_vertices(vertices)
    if triples is None:
        triples = straight_triples(topology)
    return second_differences(vertices, triples).square().sum(-1)


def polyline_fairness(vertices: Tensor, topology: Topology, triples: Tensor | None = None) -> Tensor:
    """Polyline fairness ``sum |v_prev - 2 v + v_next|^2`` along the mesh polylines (paper section 5.1).

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        triples: (N, 3) vertex numbers ``previous, vertex, next``; by default those of
            :func:`torchfair.straight_triples`, which are worked out anew at every call. The module
            :class:`PolylineFairness` does so once.

    Returns:
        (*batch,) >= 0, unit length^2, unchanged by rigid motions: whole squares; the weight of
        :func:`~torchfair.constraints.polyline_fairness_terms` counts an eighth. A quadratic polynomial, smooth
        everywhere; 0 where polylines are straight and evenly spaced. Goes to 0 like h^2 when a mesh of a fixed surface
        is refined regularly to edge length h. Degenerate faces are of no consequence.

    Raises:
        ShapeError: if ``vertices`` or ``triples`` has the wrong shape or dtype.

    Example:
        >>> from torchfair.energies import polyline_fairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> polyline_fairness(mesh.vertices, mesh.topology)
        tensor(5.6819, dtype=torch.float64)
    """
    if triples is None:
        triples = straight_triples(topology)
    terms = polyline_fairness_per_triple(vertices, topology, triples)
    return topology.sum_per_mesh(terms, topology.sums_over(triples[:, 1])) if topology.is_joined else terms.sum(-1)


@safe_to_load
class PolylineFairness(MeshModule):
    """Module form of :func:`polyline_fairness`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Args:
        topology: connectivity of all meshes that the module is called with.
        triples: (N, 3) vertex numbers ``previous, vertex, next``; by default those of
            :func:`torchfair.straight_triples`.
        reduction: see :class:`MeshModule`.

    Attributes:
        triples: the triples, on the device of the topology.

    Raises:
        ShapeError: if ``triples`` is not an integer tensor (N, 3).
        MeshError: if a triple uses a vertex that the topology does not have.

    Example:
        >>> from torchfair.energies import PolylineFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> energy = PolylineFairness(mesh.topology)
        >>> energy(mesh.vertices)
        tensor(5.6819, dtype=torch.float64)
        >>> batch = mesh.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    def __init__(self, topology: Topology, triples: Tensor | None = None, *, reduction: Reduction = "none") -> None:
        super().__init__(topology, reduction=reduction)
        triples = straight_triples(topology) if triples is None else triples
        check_triples(triples)
        outside = ((triples < 0) | (triples >= topology.num_vertices)).any(1).nonzero().squeeze(1)
        if outside.numel():
            raise MeshError(
                f"{outside.numel()} triple(s) use vertex numbers out of range 0..{topology.num_vertices - 1}, "
                f"the first is triple {int(outside[0])}: {triples[outside[0]].tolist()}. Count vertices from zero."
            )
        self.triples = triples.to(topology.device)
        self._sums = topology.sums_over(self.triples[:, 1])

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> MeshModule:
        super()._apply(fn, recurse)
        if self.triples.device != self.topology.device:
            self.triples = self.triples.to(self.topology.device)
            self._sums = self.topology.sums_over(self.triples[:, 1])
        return self

    def per_triple(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, N); see :func:`polyline_fairness_per_triple`."""
        return polyline_fairness_per_triple(vertices, self.topology, self.triples)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Energy (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_triple(vertices), self._sums)
