"""``trimesh.Trimesh``."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..topology import Manifold, Topology
from ._attributes import read


def from_trimesh(mesh: Any, *, manifold: Manifold = "vertices") -> tuple[Tensor, Topology]:
    """Vertices (V, 3) in float64 and topology of a ``Trimesh``, by its ``vertices`` and ``faces``.

    Args:
        mesh: one mesh; trimesh welds vertices when it makes one, unless told ``process=False``.
        manifold: see :meth:`torchfair.Topology.from_faces`.

    Raises:
        TorchfairError: if it is something else.
        MeshError: if it is no manifold; :func:`torchfair.repair_mesh` mends what can be mended.
    """
    points, faces = read(mesh, "trimesh", "vertices", "faces")
    vertices = torch.tensor(np.asarray(points, np.float64)).reshape(-1, 3)
    return vertices, Topology.from_faces(np.array(faces, np.int64), vertices.shape[0], manifold=manifold)


def as_trimesh(vertices: Tensor, topology: Topology) -> dict[str, Any]:
    """Arguments of ``Trimesh`` for one mesh: ``Trimesh(**as_trimesh(vertices, topology))``; nothing is welded.

    Args:
        vertices: (V, 3), any length unit.
        topology: of the mesh.

    Raises:
        MeshError: if a face is not a triangle.
        ShapeError: if ``vertices`` do not fit.
    """
    topology.check_vertices(vertices)
    return {
        "vertices": vertices.detach().cpu().numpy().copy(),
        "faces": topology.triangles.cpu().numpy().copy(),
        "process": False,
    }
