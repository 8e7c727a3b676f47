"""Curvature of the incomplete stars on the boundary, taken from their neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .._loading import safe_to_load
from .._tables import outside_of_transforms
from ..geometry._ops import gather, scatter_sum
from ..topology import Topology


@safe_to_load
class BoundaryExtrapolation(NamedTuple):
    """Which vertices take their density from which others; made by :func:`boundary_extrapolation`.

    Attributes:
        replaced: (V,) bool, vertices whose own density is not used.
        targets: (N,) a replaced vertex, once for every vertex that it takes from.
        sources: (N,) the vertices it takes from.
        weights: (N,) float64, summing to 1 for every replaced vertex.
    """

    replaced: Tensor
    targets: Tensor
    sources: Tensor
    weights: Tensor

    def to(self, device: torch.device) -> BoundaryExtrapolation:
        """The same tables on ``device``."""
        return BoundaryExtrapolation(*(table.to(device) for table in self))

    def apply(self, values: Tensor, areas: Tensor) -> Tensor:
        """``values`` (*batch, V), integrated over stars of ``areas`` (*batch, V), completed at the boundary."""
        density = (values / torch.where(areas > 0, areas, 1.0))[..., None]
        taken = gather(density, self.sources) * self.weights[:, None].to(values.dtype)
        filled = scatter_sum(taken, self.targets, values.shape[-1]).squeeze(-1)
        return torch.where(self.replaced, areas * filled, values)


def boundary_extrapolation(topology: Topology) -> BoundaryExtrapolation:
    """Tables by which boundary vertices take the mean density (value over area) of their interior neighbours.

    A boundary vertex without an interior neighbour, at a corner for example, takes the mean of those of its
    neighbours that have a density by then, and so on until all have one. Pieces of the mesh without any
    interior vertex keep their own. It depends on the topology only.
    """
    with outside_of_transforms():
        return _found(topology)


def _found(topology: Topology) -> BoundaryExtrapolation:
    from scipy.sparse import coo_array, diags_array

    size = topology.num_vertices
    start, stop = topology.edges.cpu().numpy().T
    ends, others = np.concatenate([start, stop]), np.concatenate([stop, start])
    beside = coo_array((np.ones(len(ends)), (ends, others)), shape=(size, size)).tocsr()
    complete = ~topology.is_boundary_vertex.cpu().numpy()
    known, shares = complete, diags_array(complete.astype(float)).tocsr()
    while True:
        counts = beside @ known.astype(float)
        fresh = ~known & (counts > 0)
        if not fresh.any():
            break
        mean = diags_array(fresh / np.maximum(counts, 1.0))
        shares = shares + mean @ (beside @ shares)  # rows of vertices that are not known are empty
        known = known | fresh
    replaced = known & ~complete
    table = (diags_array(replaced.astype(float)).tocsr() @ shares).tocoo()
    targets, sources = (torch.from_numpy(index.astype(np.int64)) for index in table.coords)
    tables = BoundaryExtrapolation(torch.from_numpy(replaced), targets, sources, torch.from_numpy(table.data))
    return tables.to(topology.device)
