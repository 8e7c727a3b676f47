"""Unit normals of faces and vertices."""

from __future__ import annotations

import torch
from torch import Tensor

from .._precision import in_single_at_least
from .._remembered import remembered
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import dot, gather, map_faces, norm, scatter_sum
from .angles import corner_angles
from .areas import area_vector

DEGENERACY = 4.0
"""A face is degenerate if ``|A_f| <= DEGENERACY * eps * (sum of its squared edge lengths)``."""


@remembered
@of_any_size(0)
def face_normals(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Unit normal of every face: its area vector divided by its area.

    It points to the side from which the corners run counterclockwise; for polygons that are not planar see
    :func:`face_area_vectors`.

    A face is *degenerate* if its area vector is not longer than ``4 eps`` times the sum of its squared edge
    lengths, eps being the rounding unit of the dtype: its direction is then rounding noise. The normal of a
    degenerate face is the zero vector and all its derivatives are zero.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, F, 3), length 1 or (degenerate faces) 0, for meshes of any size. Beside parts 1e9 times as large, in
        float32, small faces pass for degenerate.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import face_normals
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> face_normals(vertices, topology)
        tensor([[ 0.0000, -0.4472,  0.8944],
                [ 0.0000,  0.4472,  0.8944]])
    """
    topology.check_vertices(vertices)
    return map_faces(vertices, topology, unit_normal)


@in_single_at_least
def degenerate_faces(vertices: Tensor, topology: Topology) -> Tensor:
    """Mask (*batch, F) of the faces without a normal, as defined at :func:`face_normals`.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import degenerate_faces
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> degenerate_faces(vertices, topology)
        tensor([False, False])
    """
    return (face_normals(vertices, topology) == 0).all(-1)


@in_single_at_least
def vertex_normals(vertices: Tensor, topology: Topology) -> Tensor:
    """Unit normal of every vertex: the mean of its face normals weighted by the corner angles.

    With these weights the normal does not depend on how flat faces are cut into triangles.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V, 3), length 1. The zero vector, with zero derivatives, at isolated vertices and where the
        weighted normals cancel or all faces around are degenerate.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import vertex_normals
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> normals = vertex_normals(ball.vertices, ball.topology)
        >>> (normals - ball.normals).norm(dim=1).max() < 0.02
        tensor(True)
    """
    return angle_weighted(face_normals(vertices, topology), corner_angles(vertices, topology), topology)


def angle_weighted(normals: Tensor, angles: Tensor, topology: Topology) -> Tensor:
    """:func:`vertex_normals` (*batch, V, 3) of face normals (*batch, F, 3) and corner angles (*batch, H)."""
    weighted = angles[..., None] * gather(normals, topology.corner_faces)
    total = scatter_sum(weighted, topology.corners, topology.num_vertices)
    # Angles around a vertex are of order 1: anything this small is cancellation.
    return normalise(total, 64 * torch.finfo(normals.dtype).eps)


@in_single_at_least
def adjacent_normals(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor, Tensor]:
    """Normals of the two faces of every interior edge.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        Left normals (*batch, I, 3), right normals (*batch, I, 3), and the mask (*batch, I) of the edges
        with two faces that are not degenerate: only these carry a dihedral angle.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import adjacent_normals
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> left, right, degenerate = adjacent_normals(vertices, topology)
        >>> left, right
        (tensor([[ 0.0000, -0.4472,  0.8944]]), tensor([[0.0000, 0.4472, 0.8944]]))
    """
    return normals_beside(face_normals(vertices, topology), topology.interior_edge_faces)


def normals_beside(normals: Tensor, edge_faces: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The same of edges between faces (n, 2), with the normals (*batch, F, 3) of faces."""
    left, right = (gather(normals, faces) for faces in edge_faces.unbind(1))
    return left, right, (left != 0).any(-1) & (right != 0).any(-1)


def unit_normal(corners: Tensor) -> Tensor:
    """Unit normals of polygons given by their corners (*batch, n, k, 3): (*batch, n, 3)."""
    area = area_vector(corners)
    fixed = corners.detach()
    sides = fixed.roll(-1, -2) - fixed
    return normalise(area, DEGENERACY * torch.finfo(corners.dtype).eps * dot(sides, sides).sum(-1))


def normalise(x: Tensor, threshold: Tensor | float) -> Tensor:
    """``x / |x|`` where ``|x| > threshold``, else the zero vector with zero derivatives."""
    size = norm(x.detach())
    valid = ~(size <= threshold)  # NaN stays NaN: bad input must not pass for a flat mesh
    # Dividing by a constant first leaves all derivatives as they are and keeps powers of tiny lengths out of them.
    scaled = x / torch.where(valid, size, 1.0)[..., None]
    safe = torch.where(valid[..., None], scaled, 1.0)
    return torch.where(valid[..., None], safe / norm(safe)[..., None], 0.0)
