"""Edges from curve to curve are cut in two, so that no triangle has all of its corners on a line of the mesh."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from .._graph import edge_numbers
from ..fields.frames import Bools
from ..topology import Topology


def cut_bridges(vertices: Tensor, topology: Topology, sharp: Bools) -> tuple[Tensor, Topology, Bools]:
    """Cuts interior edges from a crease to a crease or to the boundary in the middle; new vertices are the last.

    Args:
        vertices: (V, 3).
        topology: triangles.
        sharp: (I,) bool: interior edges that are creases.

    Returns:
        The same surface: vertices, triangles, creases.
    """
    edges = topology.interior_edges.numpy()
    on_crease = np.zeros(topology.num_vertices, bool)
    on_crease[edges[sharp]] = True
    on_curve = on_crease | topology.is_boundary_vertex.numpy()
    bridges = np.flatnonzero(~sharp & on_curve[edges].all(1) & on_crease[edges].any(1))
    if not len(bridges):
        return vertices, topology, sharp
    middle = np.full(topology.num_edges, -1)
    middle[bridges] = topology.num_vertices + np.arange(len(bridges))
    corners, middles = topology.triangles.numpy(), middle[topology.corner_edges.numpy()].reshape(-1, 3)
    triangles = [corners[(middles < 0).all(1)].tolist()]
    for face in np.flatnonzero((middles >= 0).any(1)).tolist():
        triangles.append(_pieces(corners[face].tolist(), middles[face].tolist()))
    finer = Topology.from_faces([triangle for part in triangles for triangle in part], int(middle.max()) + 1)
    points = torch.cat([vertices, vertices[torch.from_numpy(edges[bridges])].mean(1)])
    kept = np.zeros(finer.num_interior_edges, bool)
    kept[edge_numbers(finer, torch.from_numpy(edges[sharp])).numpy()] = True
    return points, finer, kept


def _pieces(corners: list[int], middles: list[int]) -> list[list[int]]:
    """Triangles of one triangle, by its corners and the middles of the sides after them, -1 where a side stays."""
    cut = [k for k in range(3) if middles[k] >= 0]
    first = cut[0] if len(cut) != 2 else next(k for k in cut if middles[k - 2] >= 0)
    a, b, c = corners[first:] + corners[:first]
    ab, bc, ca = middles[first:] + middles[:first]
    if len(cut) == 1:
        return [[a, ab, c], [ab, b, c]]
    if len(cut) == 2:  # the sides beside b
        return [[ab, b, bc], [a, ab, c], [ab, bc, c]]
    return [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
