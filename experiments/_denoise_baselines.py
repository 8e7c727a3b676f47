"""What denoising is compared with: Taubin smoothing and bilateral normal filtering."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.linalg import vector_norm

from torchfair.geometry import face_areas, face_normals
from torchfair.topology import Topology


def taubin(
    vertices: Tensor, topology: Topology, rounds: int, *, inwards: float = 0.5, outwards: float = -0.53
) -> Tensor:
    """Umbrella smoothing that shrinks and swells in turn (Taubin 1995)."""
    first, second = topology.edges.unbind(1)
    count = topology.valences.clamp_min(1)[:, None]
    for number in range(2 * rounds):
        total = torch.zeros_like(vertices).index_add_(0, first, vertices[second]).index_add_(0, second, vertices[first])
        vertices = vertices + (outwards if number % 2 else inwards) * (total / count - vertices)
    return vertices


def bilateral_normals(
    vertices: Tensor, topology: Topology, *, width: float, rounds: int = 20, updates: int = 20
) -> Tensor:
    """Bilateral filtering of face normals, then vertices that follow them (Zheng et al. 2011, local and iterative).

    Args:
        vertices: (V, 3).
        topology: Triangles.
        width: Of the Gaussian over differences of unit normals.
        rounds: Of the filter.
        updates: Of the vertices (Sun et al. 2007).
    """
    faces = topology.corners.view(-1, 3)
    one, other = _faces_that_touch(topology)
    centres, areas, normals = vertices[faces].mean(1), face_areas(vertices, topology), face_normals(vertices, topology)
    away = vector_norm(centres[one] - centres[other], dim=1)
    left, right = topology.interior_edge_faces.unbind(1)
    reach = vector_norm(centres[left] - centres[right], dim=1).mean()
    near = areas[other] * torch.exp(-0.5 * (away / reach).square())
    for _ in range(rounds):
        alike = torch.exp(-0.5 * ((normals[one] - normals[other]).square().sum(1) / width**2))
        total = torch.zeros_like(normals).index_add_(0, one, (near * alike)[:, None] * normals[other])
        normals = torch.nn.functional.normalize(total, dim=1)
    counts = torch.bincount(topology.corners, minlength=topology.num_vertices).clamp_min(1)[:, None]
    for _ in range(updates):
        centres = vertices[faces].mean(1)
        way = centres[topology.corner_faces] - vertices[topology.corners]
        normal = normals[topology.corner_faces]
        change = (way * normal).sum(1, keepdim=True) * normal
        vertices = vertices + torch.zeros_like(vertices).index_add_(0, topology.corners, change) / counts
    return vertices


def _faces_that_touch(topology: Topology) -> tuple[Tensor, Tensor]:
    """Pairs of faces (n,), (n,) with a common vertex, each face with itself among them."""
    order = torch.argsort(topology.corners, stable=True)
    owners = topology.corner_faces[order]
    sizes = torch.bincount(topology.corners, minlength=topology.num_vertices)
    starts = sizes.cumsum(0) - sizes
    mine = sizes[topology.corners]
    one = topology.corner_faces.repeat_interleave(mine)
    place = torch.arange(one.shape[0]) - (mine.cumsum(0) - mine).repeat_interleave(mine)
    other = owners[starts[topology.corners].repeat_interleave(mine) + place]
    keys = torch.unique(one * topology.num_faces + other)
    return keys // topology.num_faces, keys % topology.num_faces
