"""What the job that lowers E reports and guarantees."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ...energies import angle_variation, normal_variation, total_mean_curvature
from ...geometry import corner_angles, face_areas, face_normals
from ...geometry.planarity import planarity
from ...normalisation import Normalisation
from ...topology import Topology

if TYPE_CHECKING:
    from .problem import FairProblem


def fair_measures(
    vertices: Tensor, start: Tensor, topology: Topology, problem: FairProblem, normalisation: Normalisation
) -> dict[str, float]:
    """Energies and guaranteed quantities of one mesh.

    Returns:
        ``normal_variation``, ``angle_variation``, ``total_mean_curvature`` (length unit of the input);
        ``mean_edge_length``; ``largest_distance`` from the reference surface and ``largest_distance_relative``
        (in mean edges of the input), for vertices that glide on a boundary curve from the nearer of both;
        ``largest_boundary_distance`` of gliding vertices from their curve; ``smallest_angle_degrees``;
        ``smallest_area_ratio`` and ``flipped_faces`` against the start; ``largest_planarity`` of the faces kept planar
        (diagonal distance over mean edge of the face); ``largest_handle_distance``.
    """
    normalised = normalisation.apply(vertices)
    distances = problem.distances(normalised)[topology.valences > 0]
    ratios = face_areas(vertices, topology) / face_areas(start, topology)
    turned = (face_normals(vertices, topology) * face_normals(start, topology)).sum(1)
    strayed = vertices.new_zeros(0) if problem.boundary is None else problem.boundary.distances(normalised)
    planar = planarity(vertices, topology)[problem.planar_faces]
    pulled = normalisation.invert(problem.targets) - vertices[problem.handles]
    return {
        "normal_variation": float(normal_variation(vertices, topology)),
        "angle_variation": float(angle_variation(vertices, topology)),
        "total_mean_curvature": float(total_mean_curvature(vertices, topology)),
        "mean_edge_length": float(Normalisation.of(vertices, topology).length),
        "largest_distance": normalisation.length * float(distances.max()),
        "largest_distance_relative": float(distances.max()),
        "largest_boundary_distance": normalisation.length * float(strayed.max()) if strayed.numel() else 0.0,
        "smallest_angle_degrees": math.degrees(float(corner_angles(vertices, topology).min())),
        "smallest_area_ratio": float(ratios.min()),
        "flipped_faces": int((turned <= 0.0).sum()),
        "largest_planarity": float(planar.max()) if planar.numel() else 0.0,
        "largest_handle_distance": float(torch.linalg.vector_norm(pulled, dim=1).max()) if pulled.numel() else 0.0,
    }
