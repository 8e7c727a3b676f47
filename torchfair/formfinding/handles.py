"""Handles as the formfinding jobs take them: places by vertex number."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import torch
from torch import Tensor

from .._names import PlacedError, few
from ..errors import MeshError, ShapeError
from ..topology import Topology

_SAME_PLACE = 1e-9  # of the extent of the mesh


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


def vertex_numbers(chosen: Iterable[int], topology: Topology, what: str = "") -> Tensor:
    """Numbers of vertices (n,).

    Args:
        chosen: The numbers.
        topology: Of the mesh.
        what: Begins the message of the error.

    Raises:
        MeshError: one is out of range.
    """
    numbers, count = list(chosen), topology.num_vertices
    wrong = [number for number in numbers if not 0 <= number < count]
    if wrong:
        raise MeshError(f"{what}vertices are numbered 0 to {count - 1}, got {wrong[:5]}")
    return torch.tensor(numbers, dtype=torch.int64)


def refuse_unreachable_handles(handles: Tensor, targets: Tensor, vertices: Tensor, stays: Tensor) -> None:
    """Handles on vertices that stay where they are, at other places than their targets.

    Args:
        handles: (n,) from :func:`read_handles`.
        targets: (n, 3) likewise.
        vertices: (V, 3) float64 start.
        stays: (V,) bool, vertices that do not move.

    Raises:
        MeshError: there are such handles.
    """
    places = vertices[handles]
    extent = (vertices.amax(0) - vertices.amin(0)).max()
    away = torch.linalg.vector_norm(places - targets, dim=1) > _SAME_PLACE * extent
    bad = handles[stays[handles] & away].tolist()
    if bad:
        raise PlacedError(
            f"{len(bad)} handle(s) cannot be reached: vertices ", few("vertex", bad),
            ". These lie on the boundary, which stays where it is. Lead the boundary curve through the targets, leave "
            "these handles out, or let the boundary glide (its corners stay even so)"
        )  # fmt: skip
