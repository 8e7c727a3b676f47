"""Edges by their ends."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology


def edge_numbers(topology: Topology, pairs: Tensor) -> Tensor:
    """Number of the edge between two vertices in either order: ``pairs`` (..., 2) to (...), -1 where there is none."""
    if not topology.num_edges:
        return torch.full_like(pairs[..., 0], -1)
    keys, order = torch.sort(_keys(topology, topology.edges))
    wanted = _keys(topology, pairs)
    place = torch.searchsorted(keys, wanted).clamp(max=topology.num_edges - 1)
    return torch.where(keys[place] == wanted, order[place], -1)


def _keys(topology: Topology, pairs: Tensor) -> Tensor:
    return pairs.amin(-1) * topology.num_vertices + pairs.amax(-1)
