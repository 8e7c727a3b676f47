"""The polar dual of a mesh: planes of faces become vertices, vertices become planes of faces."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..errors import MeshError, ShapeError
from ..geometry import face_centres, face_normals
from ..geometry._ops import dot
from ..topology import Topology
from ._groups import star_groups

_THROUGH = 1e-9  # distance of a plane from the centre over the size of the mesh, up to which it passes through it


class PolarDual(NamedTuple):
    """Planar polygons in place of the inner vertices of a mesh; made by :func:`polar_dual`.

    Attributes:
        vertices: (F, 3) poles of the face planes.
        topology: one face for every inner vertex, with as many corners as that has faces; numbers of poles are those of
            the faces. Faces of the mesh without an inner vertex are isolated vertices here.
        mesh_vertices: (n,) the inner vertex of the mesh that each face belongs to.
        one_sided: (n,) bool: all planes around that vertex have the centre on the same side. The face is then a section
            of the normal pyramid of the vertex: it intersects itself if and only if the pyramid does.
    """

    vertices: Tensor
    topology: Topology
    mesh_vertices: Tensor
    one_sided: Tensor


def polar_dual(vertices: Tensor, topology: Topology, centre: Tensor | None = None) -> PolarDual:
    """The mesh that is polar to a mesh with respect to the unit sphere around a ``centre``.

    The pole of the plane ``n . (x - c) = d`` is ``c + n / d``, and all poles of planes through a point v lie in the
    plane ``(x - c) . (v - c) = 1``: so the dual of a triangle mesh has planar faces, hexagons where vertices are
    regular, and the dual of that (over inner vertices) is the mesh again. A first step towards meshes of planar
    hexagons, as the paper suggests in its outlook (section 6).

    Corners go round a face as the faces go round the vertex. Seen along the vertex normal that is counterclockwise on
    convex stars and clockwise on saddles, whose dual faces are not convex.

    Args:
        vertices: positions (V, 3).
        topology: connectivity; triangles, or planar polygons. Planes pass through the mean of the corners.
        centre: (3,) of the unit sphere, by default the origin. No plane of a face with an inner vertex may pass through
            it. For a mesh over a plane take a point far below: then all faces are ``one_sided``.

    Returns:
        The dual, in the dtype of the vertices. Planes near the centre have poles far away. Derivatives are not given.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology, or ``centre`` is no point.
        MeshError: if the plane of a face with an inner vertex passes through the centre, or such a face has no area;
            the first few are named. Also if there is no inner vertex, or polygons meet as they cannot in a mesh.

    Example:
        >>> from torchfair.stars import polar_dual
        >>> from torchfair.shapes import icosphere
        >>> dual = polar_dual(icosphere(0).vertices, icosphere(0).topology)
        >>> dual.topology  # a dodecahedron
        Topology(polygon mesh: 20 vertices, 30 edges (0 on the boundary), 12 faces)
    """
    vertices = one_mesh(vertices, topology)
    centre = vertices.new_zeros(3) if centre is None else _point(centre).to(vertices)
    groups = list(star_groups(topology))
    if not sum(len(group.centres) for group in groups):
        raise MeshError("the mesh has no inner vertex, so that its dual has no face")
    normals, places = face_normals(vertices, topology), face_centres(vertices, topology) - centre
    distances = dot(normals, places)
    used = torch.zeros(topology.num_faces, dtype=torch.bool, device=vertices.device)
    for group in groups:
        used[topology.corner_faces[group.corners]] = True
    size = (vertices[topology.corners] - centre).abs().max()
    through = distances.abs() <= _THROUGH * size
    bad = torch.nonzero(through & used).squeeze(1).tolist()
    if bad:
        raise MeshError(
            f"the planes of {len(bad)} face(s) pass through the centre, or have no area: faces {bad[:5]}. Choose "
            "another centre, for a mesh over a plane a point far below it"
        )
    poles = centre + normals / torch.where(through, 1.0, distances)[:, None]
    poles = torch.where(used[:, None], poles, centre)
    order, faces, sides = [], [], []
    for group in groups:
        around = topology.corner_faces[group.corners]
        order.append(group.centres)
        faces += around.tolist()
        sides.append((distances[around] > 0).all(1) | (distances[around] < 0).all(1))
    dual = Topology.from_faces(faces, topology.num_faces).to(topology.device)
    return PolarDual(poles, dual, torch.cat(order), torch.cat(sides))


def _point(centre: Tensor) -> Tensor:
    if not isinstance(centre, Tensor) or centre.shape != (3,) or not bool(centre.isfinite().all()):
        actual = centre.tolist() if isinstance(centre, Tensor) else type(centre).__name__
        raise ShapeError("centre", "a tensor (3,) of finite numbers", actual)
    return centre.detach()
