"""A quick answer of meshes whose steps take long: what surrounds a handle goes along with it, less and less."""

from __future__ import annotations

import numpy as np
import torch
from scipy.sparse.csgraph import dijkstra
from torch import Tensor

from ...geometry._edge_graph import edge_graph
from ...topology import Topology

_REACH = 3.0  # times the way of a handle
_LEAST_REACH = 12.0  # mean edges


def coarse_answer(vertices: Tensor, topology: Topology, handles: Tensor, places: Tensor, stays: Tensor) -> Tensor:
    """Vertices (V, 3) with handles at their places, and a smooth hump around each.

    A vertex takes part in the move of a handle by ``s(1 - d / R)`` with ``s(t) = t^2 (3 - 2 t)`` and its way ``d`` to
    the handle along edges, up to three times the way of the handle and at least twelve mean edges; next to what stays,
    and to other handles, by less.

    Args:
        vertices: (V, 3).
        topology: Its connectivity.
        handles: (n,) vertices.
        places: (n, 3) where they are pulled.
        stays: (V,) bool, vertices that do not move; handles do in any case.
    """
    graph = edge_graph(vertices, topology)
    least = _LEAST_REACH * float(graph.data.mean())
    ways = places - vertices[handles]
    moves = torch.zeros_like(vertices)
    for handle, way in zip(handles.tolist(), ways, strict=True):
        reach = max(least, _REACH * float(way.norm()))
        near = dijkstra(graph, directed=False, indices=handle, limit=reach)
        rest = stays.clone()
        rest[handles] = True
        rest[handle] = False
        sources = np.flatnonzero(rest.numpy() & np.isfinite(near))
        free = dijkstra(graph, directed=False, indices=sources, limit=reach, min_only=True) if len(sources) else reach
        inside = np.flatnonzero(np.isfinite(near))
        part, room = 1.0 - near[inside] / reach, np.broadcast_to(np.minimum(free, reach), len(near))[inside]
        weight = part**2 * (3.0 - 2.0 * part) * room / np.maximum(room + near[inside], 1e-300)
        moves[inside] += torch.from_numpy(weight)[:, None] * way
    return vertices + moves
