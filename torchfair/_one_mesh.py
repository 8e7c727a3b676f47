"""What takes one mesh, not a batch."""

from __future__ import annotations

from torch import Tensor

from .errors import ShapeError
from .topology import Topology


def one_mesh(vertices: Tensor, topology: Topology) -> Tensor:
    """Positions ``(V, 3)`` of one mesh, detached.

    Raises:
        ShapeError: if they are a batch, or do not fit the topology.
    """
    topology.check_vertices(vertices)
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"one mesh ({topology.num_vertices}, 3), not a batch", tuple(vertices.shape))
    return vertices.detach()
