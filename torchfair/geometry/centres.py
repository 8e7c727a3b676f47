"""Centres of faces."""

from __future__ import annotations

from torch import Tensor

from .._precision import in_single_at_least
from ..topology import Topology


@in_single_at_least
def face_centres(vertices: Tensor, topology: Topology) -> Tensor:
    """Mean of the corners of every face.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, F, 3), in the unit of the vertices. For triangles the centre of mass; of other polygons it is not.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import face_centres
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> face_centres(vertices, topology)
        tensor([[1.0000, 1.0000, 0.5000],
                [1.0000, 3.0000, 0.5000]])
    """
    topology.check_vertices(vertices)
    sums = vertices.new_zeros(*vertices.shape[:-2], topology.num_faces, 3)
    sums = sums.index_add(-2, topology.corner_faces, vertices.index_select(-2, topology.corners))
    return sums / topology.face_sizes[:, None]
