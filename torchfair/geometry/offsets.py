"""Offsets of meshes at constant distance between faces, and how far vertices are from having one."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology
from ._any_size import of_any_size
from ._ops import dot, gather, scatter_sum
from .normals import face_normals


@of_any_size(0)
def offset_directions(vertices: Tensor, topology: Topology) -> Tensor:
    """Vectors x along which vertices move so that all faces move by the same distance: ``n_f . x = 1`` around each.

    Where such a vector exists the faces around the vertex touch a cone of revolution about it. Meshes of planar faces
    with such vertices are *conical*, a kind of principal quad meshes (paper, section 1.1); ``vertices + d x`` is then a
    mesh with parallel faces at the distance d. Elsewhere it is the best vector in the sense of least squares, and
    :func:`conical_deviations` is what is missing. Where several will do (flat stars, boundary vertices with one or two
    faces) it is the shortest.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed. Faces that are not planar are represented by their normals.

    Returns:
        (*batch, V, 3), dimensionless; rotates with the mesh, unchanged by scaling, reversed with all faces. Length 1
        where the star is flat, ``1 / cos`` of the angle between axis and face normals on a cone: long where faces are
        steep against each other. Zero, with zero derivatives, at isolated vertices and where normals cancel. Degenerate
        faces do not count.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import offset_directions
        >>> cube = torch.cartesian_prod(*[torch.tensor([0.0, 1.0], dtype=torch.float64)] * 3)
        >>> faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        >>> offset_directions(cube, Topology.from_faces(faces))[7].round(decimals=9)
        tensor([1., 1., 1.], dtype=torch.float64)
    """
    directions, _, _ = _directions_and_misfits(vertices, topology)
    return directions.to(vertices.dtype)


@of_any_size(0)
def conical_deviations(vertices: Tensor, topology: Topology) -> Tensor:
    """How far every vertex is from being conical: the share by which its faces miss the distance of the best offset.

    It is the root mean square over the faces around the vertex of ``n_f . x - 1`` with the ``x`` of
    :func:`offset_directions`: with an offset by d, faces pass the new vertex at the distances ``d (n_f . x)``.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V), dimensionless, >= 0, unchanged by rigid motions, scaling and turning all faces round. 0 to
        rounding at vertices with up to three faces, whatever they are, and at isolated ones. Of second order in the
        edge length on any mesh of a smooth surface, since normals differ by so little: compare meshes of one size. A
        kink at 0, with a subgradient. 1 where normals cancel.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import conical_deviations
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> conical_deviations(mesh.vertices, mesh.topology).max() < 0.02  # principal quads are nearly conical
        tensor(True)
    """
    _, misfits, counts = _directions_and_misfits(vertices, topology)
    squares = scatter_sum(misfits.square()[..., None], topology.corners, topology.num_vertices).squeeze(-1)
    positive = squares > 0
    roots = (torch.where(positive, squares, 1.0) / counts.clamp_min(1.0)).sqrt()
    return torch.where(positive, roots, 0.0).to(vertices.dtype)


_TINY = 256  # rounding units by which normals are damped that are nearly in one plane


def _directions_and_misfits(given: Tensor, topology: Topology) -> tuple[Tensor, Tensor, Tensor]:
    """Directions (*batch, V, 3), ``n . x - 1`` at corners (*batch, C), faces that count (*batch, V), in float64.

    The sum s of k normals gives ``k s / |s|^2``: the answer for up to two faces and on regular cones. Elsewhere what it
    lacks is sought, so that nothing is lost where all normals are nearly the same.
    """
    topology.check_vertices(given)
    vertices = given.to(torch.float64)
    normals = gather(face_normals(vertices, topology), topology.corner_faces)
    valid = (normals != 0).any(-1).to(vertices.dtype)
    sums = scatter_sum(torch.cat([normals, valid[..., None]], dim=-1), topology.corners, topology.num_vertices)
    total, counts = sums[..., :3], sums[..., 3]
    squared = dot(total, total)
    known = squared > (64 * torch.finfo(vertices.dtype).eps) ** 2  # less is cancellation
    start = (counts / torch.where(known, squared, 1.0))[..., None] * total
    start = torch.where(known[..., None], start, 0.0)

    missing = 1.0 - dot(normals, gather(start, topology.corners))
    squares = (normals[..., :, None] * normals[..., None, :]).flatten(-2)
    sums = scatter_sum(torch.cat([squares, missing[..., None] * normals], -1), topology.corners, topology.num_vertices)
    solved = (known & (counts > 2))[..., None]
    eye = torch.eye(3, dtype=vertices.dtype, device=vertices.device)
    damping = _TINY * torch.finfo(vertices.dtype).eps * counts.clamp_min(1.0)[..., None, None]
    matrix = torch.where(solved[..., None], sums[..., :9].reshape((*sums.shape[:-1], 3, 3)), eye) + damping * eye
    change = torch.linalg.solve(matrix, torch.where(solved, sums[..., 9:], 0.0)[..., None]).squeeze(-1)
    directions = start + change
    return directions, valid * (dot(normals, gather(directions, topology.corners)) - 1.0), counts
