"""Normals of the planes to which shape operators are restricted."""

from __future__ import annotations

import torch
from torch import Tensor

from .._precision import in_single_at_least
from .._remembered import remembered
from ..topology import Topology
from ._ops import gather, scatter_sum
from .normals import face_normals, normalise


@remembered
@in_single_at_least
def star_normals(vertices: Tensor, topology: Topology) -> Tensor:
    """Unit vector along the plain sum of the face normals around every vertex (paper section 5.3, item 6).

    The plane orthogonal to it is the tangent plane in which the curvatures of the star are taken. For
    shading :func:`vertex_normals` is the better choice: it does not depend on how flat faces are cut.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V, 3), length 1. The zero vector, with zero derivatives, at isolated vertices and where the
        normals cancel or all faces around are degenerate.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import star_normals
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> normals = star_normals(ball.vertices, ball.topology)
        >>> normals.shape
        torch.Size([162, 3])
    """
    corners = gather(face_normals(vertices, topology), topology.corner_faces)
    total = scatter_sum(corners, topology.corners, topology.num_vertices)
    return normalise(total, 64 * torch.finfo(vertices.dtype).eps)  # sums of unit vectors: less is cancellation
