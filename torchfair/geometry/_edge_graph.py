"""The graph of vertices and edges, as SciPy walks through it."""

from __future__ import annotations

from scipy.sparse import coo_array, csr_array
from torch import Tensor

from ..topology import Topology
from .lengths import edge_lengths


def edge_graph(vertices: Tensor, topology: Topology) -> csr_array:
    """(V, V) with the length of every edge, once: shortest ways along it take ``directed=False``."""
    count, (v, w) = topology.num_vertices, topology.edges.numpy().T
    return coo_array((edge_lengths(vertices, topology).numpy(), (v, w)), shape=(count, count)).tocsr()
