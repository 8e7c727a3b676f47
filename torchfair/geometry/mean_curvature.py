"""Integrated mean-curvature vectors."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology
from ._any_size import of_any_size
from ._ops import cross, face_groups, gather, scatter_sum
from .normals import unit_normal


@of_any_size(1)
def mean_curvature_vectors(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Mean-curvature vector of every vertex, integrated over its star.

    ``H_v = 1/2 grad_v (total area)``. In a triangle mesh that is the cotangent formula
    ``H_v = 1/4 sum_w (cot a + cot b) (v - w)``::

                 a
               /   \          a, b: angles opposite
              v --- w         the edge (v, w)
               \   /
                 b

    It stands for the integral of ``H n`` with the mean curvature ``H = (k1 + k2)/2`` (positive where convex)
    and the unit normal ``n``: it points along ``n`` where the surface is convex and does not depend on the
    orientation of the faces. Divide by a vertex area for the pointwise value. In polygon meshes the area of
    a face is the length of its area vector.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V, 3), same unit as the vertices. Zero at isolated vertices and at interior vertices with
        flat stars; at boundary vertices it contains the pull of the boundary and is not a curvature.
        Degenerate faces (see :func:`face_normals`) contribute nothing, with zero derivatives.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import mean_curvature_vectors
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> vectors = mean_curvature_vectors(ball.vertices, ball.topology)
        >>> vectors.shape  # integrals over the stars
        torch.Size([162, 3])
    """
    topology.check_vertices(vertices)
    groups = [corners for _, corners in face_groups(topology)]
    pulls = [_half_area_gradient(gather(vertices, corners)).flatten(-3, -2) for corners in groups]
    receivers = torch.cat([corners.flatten() for corners in groups])
    return scatter_sum(torch.cat(pulls, dim=-2), receivers, topology.num_vertices)


def _half_area_gradient(corners: Tensor) -> Tensor:
    """Half the gradient of the areas of polygons by their corners: (*batch, n, k, 3) to the same shape.

    The area of a face is ``n . A``, and moving corner ``i`` changes ``A`` by ``1/2 dv x (next - previous)``.
    """
    span = corners.roll(1, -2) - corners.roll(-1, -2)
    return cross(unit_normal(corners)[..., None, :], span) / 4
