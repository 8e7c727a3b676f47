"""``pytorch3d.structures.Meshes``."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from ..batches import MeshBatch, mesh_from_lists
from ..topology import Manifold
from ._attributes import read


def from_pytorch3d(meshes: Any, *, manifold: Manifold = "vertices") -> MeshBatch:
    """The batch of a ``Meshes``, by its ``verts_list()`` and ``faces_list()``.

    Args:
        meshes: with gradients, if its vertices have them.
        manifold: see :meth:`torchfair.Topology.from_faces`.

    Raises:
        TorchfairError: if it is something else.
        MeshError: naming the mesh, if it is no manifold.
    """
    verts, faces = read(meshes, "PyTorch3D", "verts_list", "faces_list")
    return mesh_from_lists(verts(), faces(), manifold=manifold)


def as_pytorch3d(batch: MeshBatch) -> dict[str, list[Tensor]]:
    """Arguments of ``Meshes``: ``Meshes(**as_pytorch3d(batch))``. Derivatives with respect to vertices pass through.

    Raises:
        MeshError: if a face is not a triangle.
    """
    batch.topology.require_triangles()
    meshes = list(batch)
    return {"verts": [vertices for vertices, _ in meshes], "faces": [topology.triangles for _, topology in meshes]}
