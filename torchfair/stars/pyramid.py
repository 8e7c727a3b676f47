"""Normal pyramids: the face normals around a vertex, joined on the unit sphere (paper section 2.2)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from .._side_by_side import side_by_side
from ..errors import MeshError
from ..geometry import corner_angles, dihedral_angles, face_normals
from ..geometry._ops import cross, dot, gather, scatter_sum
from ..geometry.normals import angle_weighted
from ..topology import Topology
from ._groups import StarGroup, star_groups, star_parts
from .arcs import arc_crossings

_ROOM = 1 << 18  # entries of the tables of one chunk of pyramids: few enough for the cache
_POINTS = 1 << 15  # normals looked at together, likewise


def normal_pyramid(vertices: Tensor, topology: Topology, vertex: int) -> Tensor:
    """The face normals (*batch, k, 3) around one inner ``vertex``, counterclockwise.

    Row ``i`` is the face between the neighbours ``i`` and ``i + 1`` of the ring; the arc from row ``i - 1`` to
    row ``i`` belongs to the edge to neighbour ``i``. Joined to a closed polygon on the unit sphere they are the
    normal pyramid of the vertex, cut off by the sphere. Degenerate faces have a zero row.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        vertex: its number.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        MeshError: if there is no such inner vertex.
    """
    topology.check_vertices(vertices)
    return gather(face_normals(vertices, topology), pyramid_faces(topology, vertex))


def pyramid_faces(topology: Topology, vertex: int) -> Tensor:
    """Numbers (k,) of the faces around an inner vertex, in the order of :func:`normal_pyramid`; errors as there."""
    for group in star_groups(topology):
        row = torch.nonzero(group.centres == vertex)
        if row.numel():
            return topology.corner_faces[group.corners[int(row[0, 0])]]
    raise MeshError(f"vertex {vertex} has no normal pyramid: choose a vertex inside the mesh, not on its boundary")


def pyramid_perimeters(vertices: Tensor, topology: Topology) -> Tensor:
    """Perimeter of every normal pyramid: the sum of ``|a|`` over the edges at the vertex, in radians.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V), at least 0; 0 at boundary vertices and isolated ones. An edge between opposite normals
        counts pi, an edge beside a degenerate face or without length 0. Below 2 pi at convex vertices.
        Derivatives as for :func:`torchfair.geometry.dihedral_angles`, with a kink (and 0) at flat edges.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
    """
    angles = dihedral_angles(vertices, topology).abs()[..., None]
    start, stop = topology.interior_edges.unbind(1)
    count = topology.num_vertices
    total = scatter_sum(angles, start, count) + scatter_sum(angles, stop, count)
    return torch.where(topology.is_boundary_vertex, 0.0, total.squeeze(-1))


def pyramid_self_intersections(vertices: Tensor, topology: Topology) -> Tensor:
    """Number of self-intersections of every normal pyramid: pairs of its arcs that cross.

    Two arcs cross if they intersect in an inner point of both, not merely touch; see
    :func:`~torchfair.stars.arc_crossings` for what is decided in borderline cases. The paper calls a mesh
    visually smooth only if all these numbers are zero (section 1).

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V) int64; 0 at boundary vertices, isolated ones and of valence 3. Does not change under
        similarity transformations, reflections and reversal of all faces. Not differentiable.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
    """
    topology.check_vertices(vertices)
    vertices = vertices.detach()
    normals, noise = face_normals(vertices, topology), normal_noise(vertices, topology)
    counts = torch.zeros(vertices.shape[:-1], dtype=torch.int64, device=vertices.device)
    batch = max(1, math.prod(vertices.shape[:-2]))

    def count(part: StarGroup) -> None:
        faces = topology.corner_faces[part.corners]
        crossings = arc_crossings(gather(normals, faces), noise[..., faces].amax(-1))
        counts[..., part.centres] = crossings.sum((-2, -1)) // 2

    side_by_side(count, star_parts(topology, lambda valence: _ROOM // (batch * valence**2)), vertices)
    return counts


def pyramid_windings(vertices: Tensor, topology: Topology) -> Tensor:
    """How often every normal pyramid runs around the vertex normal, counterclockwise positive.

    1 for convex stars, -1 for good saddles and wherever the plane orthogonal to the vertex normal shows a
    saddle, -2 for a monkey saddle. In general it is ``1 - c / 2`` if the star projects 1-1 along the normal and
    the plane meets it in c segments. The orientation of the pyramid is the sign.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V) int64; 0 at boundary vertices, isolated ones and where the vertex normal is zero. Where the
        pyramid passes through the vertex normal, one of the numbers on its two sides.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
    """
    vertices = vertices.detach()
    normals = face_normals(vertices, topology)
    axes = angle_weighted(normals, corner_angles(vertices, topology), topology)
    windings = torch.zeros(vertices.shape[:-1], dtype=torch.int64, device=vertices.device)
    batch = max(1, math.prod(vertices.shape[:-2]))

    def wind(part: StarGroup) -> None:
        axis = gather(axes, part.centres)[..., None, :]
        rows = gather(normals, topology.corner_faces[part.corners])
        rows = rows - dot(rows, axis)[..., None] * axis
        ahead = rows.roll(-1, -2)
        turns = torch.atan2(dot(cross(rows, ahead), axis), dot(rows, ahead)).sum(-1) / (2 * math.pi)
        windings[..., part.centres] = torch.nan_to_num(turns).round().to(torch.int64)

    side_by_side(wind, star_parts(topology, lambda valence: _POINTS // (batch * valence)), vertices)
    return windings


def normal_noise(vertices: Tensor, topology: Topology) -> Tensor:
    """(*batch, F) angle by which rounding of the coordinates may turn the normal of each face.

    Coordinates are known to the rounding unit times their size, and a face turns the more the smaller its
    area is compared with its perimeter. Infinite for degenerate faces.
    """
    from ..geometry import edge_lengths, face_areas

    sides = edge_lengths(vertices, topology)[..., topology.corner_edges, None]
    perimeters = scatter_sum(sides, topology.corner_faces, topology.num_faces).squeeze(-1)
    scale = vertices.abs().amax(-1)[..., topology.corners]
    largest = torch.zeros_like(perimeters)
    index = topology.corner_faces.expand(scale.shape)
    largest = largest.scatter_reduce(-1, index, scale, "amax")
    areas = face_areas(vertices, topology)
    noise = 4 * torch.finfo(vertices.dtype).eps * (largest + perimeters) * perimeters / areas
    return torch.nan_to_num(noise, nan=torch.inf)
