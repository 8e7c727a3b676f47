"""What the formfinding jobs ask of their start."""

from __future__ import annotations

import torch
from torch import Tensor

from .._names import PlacedError, few
from ..errors import ShapeError
from ..geometry import degenerate_faces
from ..topology import Topology


def one_start(vertices: Tensor, topology: Topology) -> Tensor:
    """The start (V, 3) as float64 on the CPU.

    Raises:
        ShapeError: vertices are not ``(V, 3)``.
    """
    topology.check_vertices(vertices)
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"({topology.num_vertices}, 3), one mesh", tuple(vertices.shape))
    return vertices.detach().to("cpu", torch.float64)


def refuse_degenerate_faces(vertices: Tensor, topology: Topology) -> None:
    """Raises MeshError naming the first faces of a mesh (V, 3) that have no area."""
    bad = torch.nonzero(degenerate_faces(vertices, topology)).squeeze(1).tolist()
    if bad:
        raise PlacedError(
            f"{len(bad)} face(s) have no area: faces ",
            few("face", bad),
            ". torchfair.repair_mesh (--repair) drops them; or move their vertices apart first.",
        )
