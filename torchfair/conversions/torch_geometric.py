"""``torch_geometric.data.Data`` and ``Batch``."""

from __future__ import annotations

import itertools
from typing import Any

import torch
from torch import Tensor

from ..batches import MeshBatch, mesh_from_lists
from ..topology import Manifold, Topology
from ._attributes import read


def from_torch_geometric(data: Any, *, manifold: Manifold = "vertices") -> MeshBatch:
    """The batch of a ``Data`` or ``Batch`` with positions ``pos`` (V, 3) and triangles ``face`` (3, F).

    The meshes of a ``Batch`` are told by its ``ptr``; a ``Data`` is one.

    Args:
        data: a mesh or several.
        manifold: see :meth:`torchfair.Topology.from_faces`.

    Raises:
        TorchfairError: if it is something else, or has no faces.
        MeshError: naming the mesh, if it is no manifold.
    """
    vertices, faces = read(data, "PyTorch Geometric", "pos", "face")
    ptr = getattr(data, "ptr", None)
    bounds = [0, vertices.shape[0]] if ptr is None else ptr.tolist()
    of_face = torch.bucketize(faces[0].contiguous(), torch.tensor(bounds[1:-1], device=faces.device), right=True)
    parts = [
        (vertices[start:stop], faces[:, of_face == number].T - start)
        for number, (start, stop) in enumerate(itertools.pairwise(bounds))
    ]
    return mesh_from_lists([part[0] for part in parts], [part[1] for part in parts], manifold=manifold)


def as_torch_geometric(vertices: Tensor, topology: Topology) -> dict[str, Tensor]:
    """Arguments of ``Data`` for one mesh: ``Data(**as_torch_geometric(vertices, topology))``.

    Beside ``pos`` (V, 3) and ``face`` (3, F), the latter for triangles only, there is ``edge_index`` (2, 2 E) with
    both directions of every edge of whatever polygons.

    Raises:
        MeshError: if several meshes are joined; go through a :class:`~torchfair.batches.MeshBatch` and use
            ``Batch.from_data_list``.
    """
    topology.require_one_mesh("as_torch_geometric")
    topology.check_vertices(vertices)
    edges = topology.edges.T
    found = {"pos": vertices, "edge_index": torch.cat([edges, edges.flip(0)], dim=1)}
    return {**found, "face": topology.triangles.T.contiguous()} if topology.is_triangular else found
