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

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import gauss_image
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> image = gauss_image(vertices, topology)
        >>> image.arcs.shape  # one for the ridge, between two of image.points
        torch.Size([1, 2])
    """
    return GaussImage(face_normals(vertices, topology), topology.interior_edge_faces)
