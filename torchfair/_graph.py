"""The edges of a mesh as a graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from .topology import Topology

if TYPE_CHECKING:
    import scipy.sparse as sp


def graph_laplacian(topology: Topology) -> sp.csr_array:
    """(V, V) SciPy matrix: the number of edges on the diagonal, -1 for every edge."""
    from scipy.sparse import coo_array, diags_array

    v, w = topology.edges.cpu().numpy().T
    size = topology.num_vertices
    ends, others = np.concatenate([v, w]), np.concatenate([w, v])
    edges = coo_array((np.ones(len(ends)), (ends, others)), shape=(size, size)).tocsr()
    laplacian: sp.csr_array = (diags_array(topology.valences.cpu().numpy().astype(float)) - edges).tocsr()
    return laplacian


def edge_numbers(topology: Topology, pairs: Tensor) -> Tensor:
    """Number of the edge between two vertices in either order: ``pairs`` (..., 2) to (...), -1 where there is none."""
    if not topology.num_edges:
        return torch.full_like(pairs[..., 0], -1)
    keys, order = torch.sort(_edge_keys(topology, topology.edges))
    wanted = _edge_keys(topology, pairs)
    place = torch.searchsorted(keys, wanted).clamp(max=topology.num_edges - 1)
    return torch.where(keys[place] == wanted, order[place], -1)


def _edge_keys(topology: Topology, pairs: Tensor) -> Tensor:
    return pairs.amin(-1) * topology.num_vertices + pairs.amax(-1)
