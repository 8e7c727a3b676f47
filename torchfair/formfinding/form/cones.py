"""How a surface of low C follows its handles, roughly: as cones over what stays."""

from __future__ import annotations

import numpy as np
import torch
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from torch import Tensor

from ...geometry._edge_graph import edge_graph
from ...topology import Topology


def cone_weights(vertices: Tensor, topology: Topology, handles: Tensor, stays: Tensor) -> Tensor:
    """Shares in which vertices take part in moves of handles: 1 at the handle, 0 where others are and where all stays.

    In between, the distance from what stays over the sum of that and the distance from the handle, along edges: on a
    plane a handle raises a cone, which has the least C of all surfaces through it and around it.

    Args:
        vertices: (V, 3).
        topology: Its connectivity.
        handles: (n,) vertices.
        stays: (V,) bool, vertices that do not move.

    Returns:
        (V, n); a handle without anything that stays moves its whole component.
    """
    graph = edge_graph(vertices, topology)
    result = torch.zeros(topology.num_vertices, handles.numel(), dtype=vertices.dtype)
    for column, handle in enumerate(handles.tolist()):
        rest = stays.clone()
        rest[handles] = True
        rest[handle] = False
        from_handle, from_rest = (
            _distances(graph, sources) for sources in ([handle], torch.nonzero(rest).flatten().tolist())
        )
        moves = torch.from_numpy(np.isfinite(from_handle) & (from_rest > 0.0))
        ways = (torch.from_numpy(from_handle)[moves], torch.from_numpy(from_rest)[moves])
        result[moves, column] = 1.0 / (1.0 + ways[0] / ways[1])
    return result


def _distances(graph: csr_array, sources: list[int]) -> np.ndarray:
    """(V,) shortest ways from the nearest of the sources; infinity where there is none."""
    if not sources:
        return np.full(graph.shape[0], np.inf)
    found: np.ndarray = dijkstra(graph, directed=False, indices=sources, min_only=True)
    return found
