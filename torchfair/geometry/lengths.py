"""Edge vectors and edge lengths."""

from __future__ import annotations

from torch import Tensor

from .._precision import in_single_at_least
from .._remembered import remembered
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import norm


@in_single_at_least
def edge_vectors(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Vector ``w - v`` along every edge ``(v, w)``, boundary edges included.

    The left face of the edge traverses it from ``v`` to ``w``::

              left face
          v -----------> w
              right face

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity.

    Returns:
        (*batch, E, 3), same unit; interior edges first. Zero where both ends coincide.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import edge_vectors
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> edge_vectors(vertices, topology)[0]  # along the ridge
        tensor([-2.,  0.,  0.])
    """
    topology.check_vertices(vertices)
    v, w = topology.edges.unbind(1)
    return vertices.index_select(-2, w) - vertices.index_select(-2, v)


@remembered
@of_any_size(1)
def edge_lengths(vertices: Tensor, topology: Topology) -> Tensor:
    """Length of every edge, boundary edges included.

    Differentiable wherever the edge has positive length; at length zero the value is 0 and all derivatives
    are 0 (a subgradient).

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity.

    Returns:
        (*batch, E), same unit, >= 0; interior edges first: ``[..., :topology.num_interior_edges]``.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import edge_lengths
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> edge_lengths(vertices, topology)  # the ridge first: interior edges come before the boundary
        tensor([2.0000, 2.0000, 2.2361, 2.2361, 2.2361, 2.2361, 2.0000])
    """
    return norm(edge_vectors(vertices, topology))
