"""What the job that lowers C reports."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...constraints import BoundaryNormals
from ...energies import (
    angle_variation,
    normal_variation,
    total_absolute_curvature,
    total_frobenius_curvature,
    total_mean_curvature,
)
from ...geometry import corner_angles, edge_lengths, face_areas
from ...topology import Topology


def form_measures(
    vertices: Tensor, topology: Topology, normals: Tensor, handles: Tensor, targets: Tensor
) -> dict[str, float]:
    """Energies and conditions of one mesh, in units of the input.

    Returns:
        ``total_absolute_curvature``, ``total_frobenius_curvature``, ``normal_variation``, ``angle_variation``,
        ``total_mean_curvature`` (length), ``area``, ``mean_edge_length``, ``smallest_angle_degrees``,
        ``largest_tilt_degrees`` between prescribed normals and those at the boundary (:class:`BoundaryNormals`), and
        ``largest_handle_distance``.
    """
    gaps = torch.linalg.vector_norm(vertices[handles] - targets, dim=1)
    return {
        "total_absolute_curvature": float(total_absolute_curvature(vertices, topology)),
        "total_frobenius_curvature": float(total_frobenius_curvature(vertices, topology)),
        "normal_variation": float(normal_variation(vertices, topology)),
        "angle_variation": float(angle_variation(vertices, topology)),
        "total_mean_curvature": float(total_mean_curvature(vertices, topology)),
        "area": float(face_areas(vertices, topology).sum()),
        "mean_edge_length": float(edge_lengths(vertices, topology).mean()),
        "smallest_angle_degrees": math.degrees(float(corner_angles(vertices, topology).min())),
        "largest_tilt_degrees": math.degrees(_largest_tilt(vertices, topology, normals)),
        "largest_handle_distance": float(gaps.max()) if gaps.numel() else 0.0,
    }


def _largest_tilt(vertices: Tensor, topology: Topology, normals: Tensor) -> float:
    """Largest angle between prescribed normals (V, 3), zero where none, and those of the surface there."""
    chosen = torch.nonzero((normals != 0.0).any(1)).squeeze(1)
    if not chosen.numel():
        return 0.0
    found = BoundaryNormals.of(vertices, topology).at_boundary[chosen]
    sine = torch.linalg.vector_norm(torch.linalg.cross(found, normals[chosen]), dim=1)
    return float(torch.atan2(sine, (found * normals[chosen]).sum(1)).max())
