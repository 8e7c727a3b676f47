"""Vertices where the planes of their faces meet, from which polygons of five and more corners become planar."""

from __future__ import annotations

import torch
from torch import Tensor

from ...geometry import face_normals
from ...topology import Topology

_SAME = 1e-9  # over the largest eigenvalue: planes that differ less count as one
_FARTHEST = 1.0  # mean edge lengths; planes that meet farther away are too much alike


def on_face_planes(vertices: Tensor, topology: Topology, faces: Tensor) -> Tensor:
    """The places (V, 3) nearest to all planes of the ``faces`` (n,) at a vertex, and among them to the vertex.

    A plane goes through the mean of the corners of a face, along its area vector. Where at most three of the faces meet
    at every vertex, as in a honeycomb, all of them are planar then. Hexagons on a saddle need two corners that turn
    inwards, a way off in the tangent planes: steps that make convex ones planar fold them to lines instead. Vertices
    that would move by more than a mean edge length stay.

    Args:
        vertices: (V, 3), with a mean edge length of 1.
        topology: Their connectivity.
        faces: Numbers of faces.
    """
    chosen = torch.zeros(topology.num_faces, dtype=torch.bool).index_fill(0, faces, True)[topology.corner_faces]
    corners, owners = topology.corners[chosen], topology.corner_faces[chosen]
    normals = face_normals(vertices, topology)
    means = torch.zeros_like(normals).index_add(0, topology.corner_faces, vertices[topology.corners])
    means = means / topology.face_sizes[:, None]
    normal = normals[owners]
    gaps = ((means[owners] - vertices[corners]) * normal).sum(1)
    products = vertices.new_zeros(len(vertices), 3, 3)
    products = products.index_add(0, corners, normal[:, :, None] * normal[:, None, :])
    sums = torch.zeros_like(vertices).index_add(0, corners, gaps[:, None] * normal)
    moves = (torch.linalg.pinv(products, rtol=_SAME, hermitian=True) @ sums[:, :, None]).squeeze(2)
    far = torch.linalg.vector_norm(moves, dim=1) > _FARTHEST
    return vertices + torch.where(far[:, None], 0.0, moves)
