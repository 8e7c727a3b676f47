"""Corners of the boundary of a surface, on a mesh of it whose polygons become planar."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ...boundary import boundary_corners
from ...topology import Topology

_MOST_HELD = 2  # corners of a face: three would hold its plane
_AT = 1e-4  # of an edge: what rounding to single precision moves


def corners_of_surface(
    vertices: Tensor, surface: tuple[Tensor, Topology], spacing: float, corner_angle: float
) -> Tensor:
    """(n,) numbers of the vertices that lie at corners of the boundary of a surface.

    Args:
        vertices: (V, 3) of the mesh.
        surface: vertices and topology.
        spacing: length of edges of the mesh.
        corner_angle: the boundary has a corner where it turns by more, radians.
    """
    from scipy.spatial import KDTree  # here, because the page of designs would wait for it

    points, topology = surface
    corners = points[boundary_corners(points, topology, corner_angle)].double().cpu()
    if not len(corners):
        return torch.zeros(0, dtype=torch.long)
    gaps, nearest = map(np.asarray, KDTree(vertices.double().cpu().numpy()).query(corners.numpy()))
    return torch.from_numpy(np.unique(nearest[gaps <= _AT * spacing]))


def held_corners(topology: Topology, corners: Tensor) -> list[int]:
    """Those of some vertices (n,) that belong to no face with three of them, which could not become planar."""
    around, faces = topology.corners.cpu(), topology.corner_faces.cpu()
    chosen = torch.zeros(topology.num_vertices, dtype=torch.long).index_fill(0, corners, 1)
    of_faces = torch.zeros(topology.num_faces, dtype=torch.long).index_add(0, faces, chosen[around])
    chosen[around[of_faces[faces] > _MOST_HELD]] = 0
    held: list[int] = chosen.nonzero()[:, 0].tolist()
    return held
