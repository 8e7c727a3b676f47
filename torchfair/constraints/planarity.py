"""Chosen faces stay or become planar."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..projection import ElementTerm
from ..topology import Topology


def diagonal_distance(x: Tensor) -> Tensor:
    """Signed distance between the lines of the two diagonals of a quad ``x`` (4, 3); zero when planar.

    Infinite for parallel diagonals, which no convex quad has.
    """
    normal = cross(x[2] - x[0], x[3] - x[1])
    distance: Tensor = torch.dot(normal, x[1] - x[0]) / vector_norm(normal)
    return distance


def planarity_terms(topology: Topology, faces: Tensor, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Distance of the diagonals of every four consecutive corners of ``faces`` (n,), in the unit of the vertices.

    Triangles among the faces are planar anyway and are passed over.
    """
    chosen = torch.zeros(topology.num_faces, dtype=torch.bool, device=topology.device)
    chosen[faces] = True
    rows = []
    for size, (numbers, corners) in topology.faces_by_size.items():
        if size > 3:
            kept = corners[chosen[numbers]]
            shifts = range(1) if size == 4 else range(size)
            rows += [kept.roll(-shift, 1)[:, :4] for shift in shifts]
    stencil = torch.cat(rows) if rows else torch.zeros(0, 4, dtype=torch.int64, device=topology.device)
    if not stencil.numel():
        return []
    return [ElementTerm("planarity", diagonal_distance, [(block, stencil)], weight=weight)]
