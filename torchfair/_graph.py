"""The edges of a mesh as a graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
