"""``kaolin.rep.SurfaceMesh``."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from ..batches import MeshBatch, mesh_from_lists
from ..errors import MeshError
from ..topology import Manifold
from ._attributes import read


def from_kaolin(mesh: Any, *, manifold: Manifold = "vertices") -> MeshBatch:
    """The batch of a ``SurfaceMesh``, by its ``vertices`` and ``faces``: one mesh, a list, or all with the same faces.

    Args:
        mesh: in any of the three batchings.
        manifold: see :meth:`torchfair.Topology.from_faces`.

    Raises:
        TorchfairError: if it is something else.
        MeshError: naming the mesh, if it is no manifold.
    """
    vertices, faces = read(mesh, "Kaolin", "vertices", "faces")
    if isinstance(vertices, Tensor) and vertices.ndim == 2:
        vertices, faces = [vertices], [faces]
    elif isinstance(faces, Tensor) and faces.ndim == 2:
        faces = [faces] * len(vertices)
    return mesh_from_lists(list(vertices), list(faces), manifold=manifold)


def as_kaolin(batch: MeshBatch) -> dict[str, list[Tensor]]:
    """Arguments of ``SurfaceMesh`` in the batching of a list: ``SurfaceMesh(**as_kaolin(batch))``.

    Raises:
        MeshError: if the faces of a mesh have different numbers of corners.
    """
    vertices, faces = [], []
    for number, (points, topology) in enumerate(batch):
        if len(topology.faces_by_size) > 1:
            raise MeshError(f"mesh {number} has faces of {len(topology.faces_by_size)} sizes; Kaolin knows one a mesh")
        size = next(iter(topology.faces_by_size), 3)
        vertices.append(points)
        faces.append(topology.corners.view(-1, size))
    return {"vertices": vertices, "faces": faces}
