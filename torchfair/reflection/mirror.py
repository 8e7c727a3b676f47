"""The law of reflection, at one place and on whole faces."""

from __future__ import annotations

from torch import Tensor

from ..cameras import Camera
from ..cameras.camera import check_camera
from ..geometry import face_centres, face_normals
from ..geometry._ops import dot
from ..topology import Topology


def mirror_directions(directions: Tensor, normals: Tensor) -> Tensor:
    """Mirrored directions ``r = d - 2 (d.n) n``.

    Args:
        directions: unit vectors ``d`` (..., 3) from the eye into the scene.
        normals: unit vectors ``n`` (..., 3) of the mirror, which broadcast with ``directions``. Their sign does not
            matter. The zero vector, the normal of degenerate faces, leaves the direction as it is.

    Returns:
        Unit vectors (..., 3) from the mirror into the scene.
    """
    return directions - 2 * dot(directions, normals)[..., None] * normals


def face_mirror_directions(vertices: Tensor, topology: Topology, camera: Camera) -> Tensor:
    """Where each face, as a plane mirror, reflects the line of sight through the mean of its corners.

    Args:
        vertices: positions (*batch, V, 3).
        topology: connectivity; any polygons, mixed.
        camera: the views.

    Returns:
        (*batch, views, F, 3) unit vectors from the face into the scene. A face without area lets the line of sight
        pass straight through.

    Raises:
        ShapeError: if ``vertices`` does not fit the topology.
        TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
    """
    check_camera(camera)
    normals = face_normals(vertices, topology)
    sights = camera.view_directions(face_centres(vertices, topology))
    return mirror_directions(sights, normals.unsqueeze(-3))
