"""Handles as the formfinding jobs take them: places by vertex number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from ..errors import MeshError, ShapeError
from ..topology import Topology


def read_handles(handles: Mapping[int, Sequence[float]], topology: Topology) -> tuple[Tensor, Tensor]:
    """Vertex numbers (n,) and targets (n, 3) float64.

    Raises:
        ShapeError: a target is not a point with finite coordinates.
        MeshError: a handle is no vertex.
    """
    targets = torch.zeros(len(handles), 3, dtype=torch.float64)
    for row, (vertex, target) in enumerate(handles.items()):
        point = torch.as_tensor(target, dtype=torch.float64)
        if point.shape != (3,) or not bool(torch.isfinite(point).all()):
            raise ShapeError(f"handle {vertex}", "three finite coordinates", target)
        if not 0 <= vertex < topology.num_vertices:
            raise MeshError(f"handle {vertex} is no vertex: numbers run from 0 to {topology.num_vertices - 1}")
        targets[row] = point
    return torch.tensor(list(handles), dtype=torch.int64), targets
