"""Edges of a lattice that lie on rows."""

from __future__ import annotations

import torch
from torch import Tensor

from .._graph import edge_numbers
from ..topology import Topology


def row_mask(topology: Topology, rows: set[tuple[int, int]]) -> Tensor:
    """(E,) bool: the edges of a mesh that are among pairs of vertices; others of these are no edges of it."""
    mask = torch.zeros(topology.num_edges, dtype=torch.bool)
    found = edge_numbers(topology, torch.tensor(sorted(rows), dtype=torch.int64).reshape(-1, 2))
    mask[found[found >= 0]] = True
    return mask
