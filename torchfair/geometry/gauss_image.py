"""The Gauss image of a mesh."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from .._precision import in_single_at_least
from ..topology import Topology
from .normals import face_normals


class GaussImage(NamedTuple):
    """Unit normals joined as their faces are.

    Attributes:
        points: (*batch, F, 3) unit normal of every face, zero for degenerate faces.
        arcs: (I, 2) numbers of the points joined by a great-circle arc: left and right face of every
            interior edge. Arc ``e`` has length ``|a_e|``, its chord length ``l*_e``.
    """

    points: Tensor
    arcs: Tensor


@in_single_at_least
def gauss_image(vertices: Tensor, topology: Topology) -> GaussImage:
    """The Gauss image: the mesh's face normals on the unit sphere, joined across interior edges.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        The points and arcs; see :class:`GaussImage` and, for degenerate faces, :func:`face_normals`.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
    """
    return GaussImage(face_normals(vertices, topology), topology.interior_edge_faces)
