"""What the job that removes noise reports and promises."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from ...energies import normal_variation
from ...geometry import face_areas
from ...topology import Topology
from ..job.promises import Promise
from .neighbourhoods import Neighbourhoods
from .unfolding import Sides

_UNFOLDED = 0.1  # of the faces that arrived flipped


def denoise_measures(
    vertices: Tensor, noisy: Tensor, topology: Topology, near: Neighbourhoods, noise: float
) -> dict[str, float]:
    """Quantities of one mesh (V, 3), against the noisy one (V, 3), both in the unit of the input.

    Returns:
        ``normal_variation`` (E) and ``noise``, the standard deviation that was taken for noise, in the length unit of
        the input; ``area``. ``volume``, where the mesh is closed. ``rms_displacement_over_noise``, the root mean
        square of the distance from the noisy vertices over the noise: 1 where that was along normals and all of it,
        and nothing else, was removed; up to about 1.2 where it was in all directions and folds were opened.
        ``largest_displacement``. ``flipped_faces`` against normals smoothed over the neighbourhood.
    """
    used = topology.valences > 0
    moved = torch.linalg.vector_norm(vertices - noisy, dim=1)[used]
    rms = float(moved.square().mean().sqrt())
    measures = {
        "normal_variation": float(normal_variation(vertices, topology)),
        "area": float(face_areas(vertices, topology).sum()),
        "noise": noise,
        "rms_displacement_over_noise": rms / noise if noise > 0.0 else 0.0,
        "largest_displacement": float(moved.max()),
        "flipped_faces": int(Sides.of(vertices, topology, near).flipped(vertices, topology).sum()),
    }
    if not bool(topology.is_boundary_vertex.any()):
        measures["volume"] = volume(vertices, topology)
    return measures


def volume(vertices: Tensor, topology: Topology) -> float:
    """Signed volume inside a closed mesh (V, 3), positive with outward faces; polygons are cut into fans."""
    centred = vertices - vertices[topology.corners].mean(0)
    total = 0.0
    for _, corners in topology.faces_by_size.values():
        x = centred[corners]
        first = x[:, :1].expand_as(x[:, 2:])
        total += float((first * torch.linalg.cross(x[:, 1:-1], x[:, 2:])).sum()) / 6.0
    return total


def denoise_promises(before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
    """Fewer than a tenth of the faces that arrived flipped are left."""
    return [
        Promise(
            "flipped faces",
            _UNFOLDED * before["flipped_faces"],
            after["flipped_faces"],
            remedy="noise larger than half an edge, or plates thinner than an edge: simplify the mesh first",
        )
    ]
