"""Boundary edges of separate parts that lie upon each other."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology


def edge_faces(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor]:
    """Faces beside every edge (meshes, E, 2), and the share (meshes, E) that each edge has in what is seen there.

    A boundary edge has its only face twice, and share 1, unless it has the same two ends, to the last bit, as other
    boundary edges: then all of them together are one edge, and each has an equal share. Where they are two, both have
    the faces of both.

    Args:
        vertices: (meshes, V, 3).
        topology: connectivity.
    """
    inner, meshes = topology.num_interior_edges, vertices.shape[0]
    face = torch.zeros_like(topology.edges[:, 0])
    face[topology.corner_edges] = topology.corner_faces
    faces = torch.cat([topology.interior_edge_faces, face[inner:, None].expand(-1, 2)]).expand(meshes, -1, -1)
    shares = vertices.new_ones(faces.shape[:2])
    count = topology.num_edges - inner
    if count == 0 or meshes == 0:
        return faces, shares
    group, sizes = _same_ends(vertices.detach(), topology)
    numbers = torch.arange(group.shape[0], device=group.device)
    total = torch.zeros_like(sizes).index_add_(0, group, numbers)
    size = sizes.index_select(0, group)
    partner = torch.where(size == 2, total.index_select(0, group) - numbers, numbers) % count
    faces, shares = faces.clone(), shares.clone()
    faces[:, inner:, 1] = face[inner:].index_select(0, partner).view(meshes, count)
    shares[:, inner:] = (1 / size).to(shares).view(meshes, count)
    return faces, shares


def _same_ends(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor]:
    """Number (meshes * boundary edges,) of the pair of places that each boundary edge joins, and how many join it."""
    meshes, places = vertices.shape[0], vertices[:, topology.loop_vertices] + 0.0  # no negative zeros
    mesh = torch.arange(meshes, device=vertices.device)[:, None, None].expand(-1, places.shape[1], 1)
    rows = torch.cat([mesh.to(places), places], dim=-1).flatten(0, 1)
    _, place = torch.unique(rows, dim=0, return_inverse=True)
    at_vertices = torch.zeros(vertices.shape[:2], dtype=torch.int64, device=vertices.device)
    at_vertices[:, topology.loop_vertices] = place.view(meshes, -1)
    low, high = at_vertices[:, topology.boundary_edges].sort(-1).values.flatten(0, 1).unbind(-1)
    _, group, sizes = torch.unique(low * rows.shape[0] + high, return_inverse=True, return_counts=True)
    return group, sizes
