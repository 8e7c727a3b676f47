"""Integrated shape operators from interpolated vertex normals."""

from __future__ import annotations

import functools

import torch
from torch import Tensor

from .._portions import portions_unless
from ..errors import ShapeError
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import cross, face_groups, gather, scatter_sum
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
    (_, corners), *others = face_groups(topology)
    if others:
        per_face = _of_polygons(vertices, normals, topology)
    else:
        portions = portions_unless(vertices.requires_grad or normals.requires_grad, len(corners), vertices)
        per_face = torch.cat([_of_faces(vertices, normals, corners[part]) for part in portions], dim=-2)
    stars = scatter_sum(gather(per_face, topology.corner_faces), topology.corners, topology.num_vertices)
    return stars.reshape((*stars.shape[:-1], 3, 3))


def _of_faces(vertices: Tensor, normals: Tensor, corners: Tensor) -> Tensor:
    """The share (*batch, n, 9) of every corner of faces (n, k) with equally many corners."""
    points, at_corners = gather(vertices, corners), gather(normals, corners)
    chord = points.roll(-1, -2) - points.roll(1, -2)
    size = corners.shape[1]
    mean = functools.reduce(torch.add, at_corners.unbind(-2)) / size
    axis = cross(mean[..., None, :].expand_as(at_corners), at_corners)
    per_corner = (axis[..., :, None] * chord[..., None, :]).flatten(-2) / 2
    return functools.reduce(torch.add, per_corner.unbind(-2)) / size


def _of_polygons(vertices: Tensor, normals: Tensor, topology: Topology) -> Tensor:
    """The same (*batch, F, 9) of any faces."""
    points, corner_normals = gather(vertices, topology.corners), gather(normals, topology.corners)
    ahead = gather(points, topology.next_corners)
    # Of the corner after the next, seen from the next one: x_{i+1} - x_{i-1}.
    chord = torch.zeros_like(points).index_copy(
        -2, topology.next_corners, gather(ahead, topology.next_corners) - points
    )
    sizes = topology.face_sizes[:, None]
    mean = scatter_sum(corner_normals, topology.corner_faces, topology.num_faces) / sizes
    axis = cross(gather(mean, topology.corner_faces), corner_normals)
    per_corner = (axis[..., :, None] * chord[..., None, :]).flatten(-2) / 2
    return scatter_sum(per_corner, topology.corner_faces, topology.num_faces) / sizes
