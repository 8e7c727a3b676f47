"""Which faces the job that lowers E keeps planar."""

from __future__ import annotations

import torch
from torch import Tensor

from ...errors import MeshError
from ...geometry.planarity import planarity
from ...topology import Topology
from .settings import FairSettings


def faces_to_keep_planar(vertices: Tensor, topology: Topology, settings: FairSettings) -> Tensor:
    """(n,) numbers of the faces that ``settings.planar`` chooses.

    Raises:
        MeshError: a face number is out of range.
    """
    polygons = topology.face_sizes > 3
    chosen = settings.planar
    if not isinstance(chosen, str):
        faces = torch.tensor(chosen, dtype=torch.int64)
        if faces.numel() and not bool(((faces >= 0) & (faces < topology.num_faces)).all()):
            raise MeshError(f"planar: face numbers run from 0 to {topology.num_faces - 1}, got {list(chosen)[:5]}")
        return faces
    if chosen == "keep":
        polygons = polygons & (planarity(vertices, topology) < settings.planar_tolerance)
    elif chosen == "none":
        polygons = torch.zeros_like(polygons)
    return torch.nonzero(polygons).squeeze(1)
