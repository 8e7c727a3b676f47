"""Polygons whose sides cross each other."""

from __future__ import annotations

import itertools

import torch
from torch import Tensor

from ...geometry import face_area_vectors
from ...geometry._ops import cross, dot
from ...topology import Topology


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
        if size == 3:
            continue
        at, along = vertices[corners], normals[faces]
        ahead = at.roll(-1, 1) - at
        apart = {}  # whether the ends of side j lie on different sides of the line through side i
        pairs = [(i, j) for i, j in itertools.combinations(range(size), 2) if j - i not in {1, size - 1}]
        for i, j in pairs + [(j, i) for i, j in pairs]:
            across = cross(along, ahead[:, i])
            first, second = (dot(across, at[:, end % size] - at[:, i]) for end in (j, j + 1))
            apart[i, j] = first * second < 0.0
        for i, j in pairs:
            crossing[faces] |= apart[i, j] & apart[j, i]
    return crossing
