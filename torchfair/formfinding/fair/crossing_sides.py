"""Polygons whose sides cross each other."""

from __future__ import annotations

import torch
from torch import Tensor

from ...geometry import face_area_vectors
from ...geometry._polygon_sides import sides_cross
from ...topology import Topology

_PAIRS = 1 << 20  # of sides that are looked at together


def crossing_sides(vertices: Tensor, topology: Topology, touching: float = 0.0) -> Tensor:
    """(F,) bool, whether two sides of a face cross, seen along its area vector.

    The area vector of such a face may look the same way as ever, and all its corners have good angles: a pentagon
    loses little by it when a short side is reversed. Sides that only touch do not cross, nor do those of triangles.

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: connectivity; any polygons.
        touching: Corners as near the line of a side as this share of the size of their face only touch it.
    """
    crossing = torch.zeros(topology.num_faces, dtype=torch.bool)
    if topology.is_triangular:
        return crossing.to(vertices.device)
    places, normals = (part.detach().cpu() for part in (vertices, face_area_vectors(vertices, topology)))
    for size, parts in topology.faces_by_size.items():
        if size == 3:
            continue
        faces, corners = (torch.split(part.cpu(), _PAIRS // size**2 + 1) for part in parts)
        for some, of in zip(faces, corners, strict=True):
            crossing[some] = torch.from_numpy(sides_cross(places[of].numpy(), normals[some].numpy(), touching))
    return crossing.to(vertices.device)
