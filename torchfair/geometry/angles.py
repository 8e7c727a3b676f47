"""Corner angles of faces and angle defects of vertices."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from .._precision import in_single_at_least
from .._remembered import remembered
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import angle_of, cross, dot, gather, norm, scatter_sum
from .areas import face_area_vectors


@remembered
@of_any_size(0)
def corner_angles(vertices: Tensor, topology: Topology) -> Tensor:
    """Interior angle of the face at every corner, in radians.

    Corner ``h`` belongs to face ``topology.corner_faces[h]`` and vertex ``topology.corners[h]``.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, H) in [0, pi], in (0, pi) for triangles that are not degenerate; reflex corners of
        polygons in (pi, 2 pi), judged against the area vector of the face. A corner beside an edge of
        length zero has angle 0. Derivatives are 0 at corners with angle exactly 0 or pi (the angle has a
        kink there) and at corners beside edges of length zero.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import corner_angles
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> torch.rad2deg(corner_angles(vertices, topology))[:4]  # of the first panel
        tensor([90., 90., 90., 90.])
    """
    topology.check_vertices(vertices)
    points = gather(vertices, topology.corners)
    ahead = _without_size(gather(points, topology.next_corners) - points)
    behind = torch.zeros_like(ahead).index_copy(-2, topology.next_corners, -ahead)  # from the corner back
    normal = cross(ahead, behind)
    sine, cosine = norm(normal), dot(ahead, behind)
    angles = angle_of(sine, cosine)
    if topology.is_triangular:
        return angles
    areas = gather(face_area_vectors(vertices, topology), topology.corner_faces)
    reflex = (dot(normal, areas) < 0) & (topology.face_sizes > 3)[topology.corner_faces]
    return torch.where(reflex, 2 * math.pi - angles, angles)


@in_single_at_least
def angle_defects(vertices: Tensor, topology: Topology) -> Tensor:
    """Angle defect of every vertex: the integrated Gaussian curvature of its star, in radians.

    ``2 pi - sum`` of the corner angles at interior vertices, ``pi - sum`` at boundary vertices (the turning
    angle of the boundary), 0 at isolated vertices. Gauss-Bonnet: they sum to 2 pi times the Euler
    characteristic, if all faces are planar and no face has an edge of length zero.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V), positive where the surface is cone-like, negative where it is saddle-like. Derivatives
        as for :func:`corner_angles`.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import angle_defects
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> angle_defects(ball.vertices, ball.topology).sum()  # 4 pi, that of every sphere
        tensor(12.5664, dtype=torch.float64)
    """
    return defects(corner_angles(vertices, topology), topology)


def defects(angles: Tensor, topology: Topology) -> Tensor:
    """:func:`angle_defects` (*batch, V) of corner angles (*batch, H)."""
    total = scatter_sum(angles[..., None], topology.corners, topology.num_vertices).squeeze(-1)
    flat = math.pi * (2 - topology.is_boundary_vertex.to(angles.dtype))
    return torch.where(topology.valences > 0, flat - total, 0.0)


def _without_size(edges: Tensor) -> Tensor:
    """Edges divided by their lengths taken as constants, zero where they have none.

    A constant factor on either side of a corner changes neither the angle nor its derivatives, and without
    it the squares inside the derivatives of atan2 would underflow for short edges.
    """
    lengths = norm(edges.detach())
    return edges / torch.where(lengths > 0, lengths, 1.0)[..., None]
