"""Triangles of a new mesh that are turned over."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry import face_centres, face_normals
from ..topology import Topology
from .components import Pieces, ReadSurface


def turned_over(pieces: Pieces, surface: ReadSurface) -> Tensor:
    """Numbers of faces whose normals are opposite to those of the surface beside their centres.

    Opposite are normals at more than a right angle both to the triangle of the surface that is nearest and to its
    smooth normals, so that a face across a sharp edge is none.

    Args:
        pieces: a mesh, of faces with an area.
        surface: that it was made from.
    """
    positions = torch.from_numpy(pieces.positions)
    topology = Topology.from_faces(pieces.faces, len(positions))
    closest = surface.reference.closest(face_centres(positions, topology))
    normals = face_normals(positions, topology)
    ahead = [(normals * of).sum(1) for of in (closest.normals, closest.smooth_normals)]
    return (torch.maximum(*ahead) < 0).nonzero().squeeze(1)
