"""Integrated shape operators from interpolated vertex normals."""

from __future__ import annotations

import functools

import torch
from torch import Tensor

from ..errors import ShapeError
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import cross, gather, map_faces, scatter_sum
from .balanced_normals import balanced_normals


@of_any_size(1)
def corrected_shape_operators(vertices: Tensor, topology: Topology, normals: Tensor | None = None) -> Tensor:
    r"""Shape operator of every vertex star as a 3x3 matrix, by interpolated corrected curvature measures.

    Instead of the jumps of face normals across edges, as in :func:`shape_operators`, it integrates the
    change of vertex normals ``u`` over the faces (Lachaud, Romon, Thibert, Coeurjolly, *Interpolated corrected
    curvature measures for polygonal surfaces*, 2020). With the mean ``m`` of the normals at the corners of a
    face, that face holds::

        W_f = m x (integral of u dx^T along the boundary of the face)
            = 1/2 sum_i (m x u_i) (x_{i+1} - x_{i-1})^T

    over its corners in order, and every corner gets an equal share, one third in triangles. For triangles
    ``tr W_f`` is the mean curvature measure of the paper just named, and ``-W_f`` its anisotropic measure
    with both arguments turned by 90 degrees: the measure has principal directions as eigenvectors, the
    normal cycle has them exchanged, and ``W_f`` follows the normal cycle so that all that is computed from
    :func:`shape_operators` can be computed from this one too. The integral over the boundary needs no
    triangulation of polygons, planar or not.

    Each face is shared in full: stars on the boundary are complete. With the default normals the error is of
    second order in the edge length on regular lattices up to the boundary, and on irregular meshes far
    below that of the normal cycle.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        normals: (*batch, V, 3) unit vertex normals, exact ones for example; by default
            :func:`balanced_normals`.

    Returns:
        (*batch, V, 3, 3), same unit as the vertices: curvature times area, positive where convex. Not quite
        symmetric. Zero for isolated vertices; flat faces with equal normals add nothing.

    Raises:
        ShapeError: if ``vertices`` or ``normals`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import corrected_shape_operators
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> operators = corrected_shape_operators(ball.vertices, ball.topology)
        >>> operators.shape  # integrals over the stars
        torch.Size([162, 3, 3])
    """
    topology.check_vertices(vertices)
    if normals is None:
        normals = balanced_normals(vertices, topology)
    elif normals.shape[-2:] != vertices.shape[-2:] or not normals.is_floating_point():
        expected = "a floating tensor (*batch, V, 3), one unit normal per vertex"
        raise ShapeError("normals", expected, f"{tuple(normals.shape)} {normals.dtype}")
    both = torch.cat(torch.broadcast_tensors(vertices, normals), dim=-1)  # type: ignore[no-untyped-call]
    per_face = map_faces(both, topology, _share)
    stars = scatter_sum(gather(per_face, topology.corner_faces), topology.corners, topology.num_vertices)
    return stars.reshape((*stars.shape[:-1], 3, 3))


def _share(corners: Tensor) -> Tensor:
    """What every corner of faces with corners and their normals (*batch, n, k, 6) has of their sums: (*batch, n, 9)."""
    points, normals = corners[..., :3], corners[..., 3:]
    chord = points.roll(-1, -2) - points.roll(1, -2)
    size = corners.shape[-2]
    mean = functools.reduce(torch.add, normals.unbind(-2)) / size
    axis = cross(mean[..., None, :].expand_as(normals), normals)
    per_corner = (axis[..., :, None] * chord[..., None, :]).flatten(-2) / 2
    return functools.reduce(torch.add, per_corner.unbind(-2)) / size
