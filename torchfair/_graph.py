"""Graphs: the edges of a mesh, and which things hang together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .topology import Topology

if TYPE_CHECKING:
    import scipy.sparse as sp

Ints = npt.NDArray[np.int64]


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


def connected(pairs: npt.NDArray[np.integer], count: int) -> Ints:
    """(count,) the component of each of so many things, from 0 on, of which ``pairs`` (n, 2) hang together."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if not count:
        return np.zeros(0, np.int64)
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def connected_in_two_colours(pairs: npt.NDArray[np.integer], differ: npt.NDArray[np.bool_], count: int) -> Ints:
    """(2, count) the component of each thing in the first colour and in the second.

    Every thing is there in both colours, joined to what goes with it: the things of ``pairs`` (n, 2) in the same
    colour, or in the other one where they ``differ`` (n,). A component that can be coloured is there twice.
    """
    ends = np.concatenate([pairs, pairs + count])
    ends[:, 1] = np.concatenate([pairs[:, 1] + count * differ, pairs[:, 1] + count * ~differ])
    return connected(ends, 2 * count).reshape(2, count)


def face_components(topology: Topology) -> Tensor:
    """(F,) the component of every face, across edges."""
    return torch.from_numpy(connected(topology.interior_edge_faces.cpu().numpy(), topology.num_faces))


def count_components(topology: Topology) -> int:
    """Number of connected pieces; isolated vertices do not count."""
    pieces = connected(topology.edges.cpu().numpy(), topology.num_vertices).max(initial=-1) + 1
    return int(pieces) - int((topology.valences == 0).sum())
