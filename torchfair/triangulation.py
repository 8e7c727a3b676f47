"""Cuts polygons into triangles without new vertices."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .topology import Topology


class Triangulation(NamedTuple):
    """Triangles that cover the faces of a mesh, in the order of the faces.

    Attributes:
        triangles: ``(*batch, T, 3)`` vertex numbers, in the orientation of their face.
        faces: ``(T,)`` the face each triangle is part of.
    """

    triangles: Tensor
    faces: Tensor


def triangulate(vertices: Tensor, topology: Topology) -> Triangulation:
    """Fans of triangles over the faces of meshes ``(*batch, V, 3)``; the same number for each mesh of the batch.

    Each polygon is fanned from the corner whose smallest triangle is the largest, measured along the area vector
    of the polygon. That covers every polygon exactly which is convex or star-shaped from one of its corners, so
    every planar quad, and splits a quad that is not planar the same way wherever it is seen from.
    """
    triangles, faces = [], []
    for size, (numbers, corners) in topology.faces_by_size.items():
        fans = _fans(size, corners.device)
        candidates = corners[:, fans]  # (n, first corner, triangle, 3)
        if size > 3:
            candidates = candidates[torch.arange(len(numbers), device=corners.device), _best_fan(vertices, candidates)]
            triangles.append(candidates.flatten(-3, -2))
        else:
            triangles.append(candidates.view(-1, 3).expand(*vertices.shape[:-2], -1, -1))
        faces.append(numbers.repeat_interleave(size - 2))
    if not triangles:
        return Triangulation(topology.corners.view(0, 3).expand(*vertices.shape[:-2], 0, 3), topology.corners)
    if len(triangles) == 1:  # in the order of the faces already
        return Triangulation(triangles[0], faces[0])
    order = torch.cat(faces).argsort(stable=True)
    return Triangulation(torch.cat(triangles, dim=-2)[..., order, :], torch.cat(faces)[order])


def _fans(size: int, device: torch.device) -> Tensor:
    """``(size or 1, size - 2, 3)`` corners of the triangles of the fan from each corner."""
    first = torch.arange(size if size > 3 else 1, device=device)[:, None]
    second = first + torch.arange(1, size - 1, device=device)
    return torch.stack([first.expand_as(second), second % size, (second + 1) % size], dim=-1)


def _best_fan(vertices: Tensor, candidates: Tensor) -> Tensor:
    """(*batch, n) the first corner of the best fan of each polygon."""
    a, b, c = vertices.detach()[..., candidates, :].unbind(-2)
    areas = torch.linalg.cross(b - a, c - a)  # (*batch, n, first corner, triangle, 3)
    signed: Tensor = (areas * areas.sum(-2, keepdim=True)).sum(-1)
    return signed.amin(-1).argmax(-1)
