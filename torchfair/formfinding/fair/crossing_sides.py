"""Polygons whose sides cross each other."""

from __future__ import annotations

import torch
from torch import Tensor

from ...geometry import face_area_vectors
from ...geometry._ops import cross
from ...topology import Topology

_PAIRS = 1 << 20  # of sides that are looked at together


def crossing_sides(vertices: Tensor, topology: Topology) -> Tensor:
    """(F,) bool, whether two sides of a face cross, seen along its area vector.

    The area vector of such a face may look the same way as ever, and all its corners have good angles: a pentagon
    loses little by it when a short side is reversed. Sides that only touch do not cross, nor do those of triangles.

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: connectivity; any polygons.
    """
    crossing = torch.zeros(topology.num_faces, dtype=torch.bool, device=vertices.device)
    normals = face_area_vectors(vertices, topology)
    for faces, corners in topology.faces_by_size.values():
        size = corners.shape[1]
        if size > 3:
            parts = (torch.split(part, _PAIRS // size**2 + 1) for part in (corners, faces))
            for of, some in zip(*parts, strict=True):
                crossing[some] = _crossing(vertices[of], normals[some])
    return crossing


def _crossing(corners: Tensor, normals: Tensor) -> Tensor:
    """(n,) of polygons (n, size, 3) that are seen along normals (n, 3)."""
    corners = corners - corners[:, :1]
    across = cross(normals[:, None], corners.roll(-1, 1) - corners)
    left = across @ corners.mT
    left = left - left.diagonal(dim1=1, dim2=2)[..., None]  # [i, j]: how far corner j lies to the left of side i
    apart = left * left.roll(-1, 2) < 0.0  # [i, j]: the ends of side j lie on both sides of the line through side i
    return (apart & apart.mT).any(2).any(1)
