"""``compas.datastructures.Mesh``."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from ..topology import Manifold, Topology
from ._attributes import read


def from_compas(mesh: Any, *, manifold: Manifold = "vertices") -> tuple[Tensor, Topology]:
    """Vertices (V, 3) in float64 and topology of a compas ``Mesh``, by ``to_vertices_and_faces()``.

    Vertices and faces are counted in the order in which the mesh has them, whatever their keys.

    Args:
        mesh: one mesh of any polygons.
        manifold: see :meth:`torchfair.Topology.from_faces`.

    Raises:
        TorchfairError: if it is something else.
        MeshError: if it is no manifold.
    """
    (convert,) = read(mesh, "compas", "to_vertices_and_faces")
    points, faces = convert()
    vertices = torch.tensor(points, dtype=torch.float64).reshape(-1, 3)
    return vertices, Topology.from_faces(faces, vertices.shape[0], manifold=manifold)


def as_compas(vertices: Tensor, topology: Topology) -> dict[str, Any]:
    """Arguments of ``Mesh.from_vertices_and_faces(**as_compas(vertices, topology))`` for one mesh of any polygons.

    Args:
        vertices: (V, 3), any length unit.
        topology: of the mesh.

    Raises:
        ShapeError: if ``vertices`` do not fit.
    """
    topology.check_vertices(vertices)
    return {"vertices": vertices.detach().cpu().tolist(), "faces": topology.face_lists()}
