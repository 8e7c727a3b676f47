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
    """
    topology.check_vertices(vertices)
    sums = vertices.new_zeros(*vertices.shape[:-2], topology.num_faces, 3)
    sums = sums.index_add(-2, topology.corner_faces, vertices.index_select(-2, topology.corners))
    return sums / topology.face_sizes[:, None]
