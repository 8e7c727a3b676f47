"""What is measured on a principal mesh."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..energies import NormalVariation
from ..geometry import corner_angles, edge_lengths, face_areas, face_centres, planarity
from ..topology import Topology
from .components import ReadSurface
from .curvature_sizes import ASKED
from .measures import angles_to_directions
from .mesh_creases import MeshCreases
from .quad_mesh import QuadMesh
from .verification import shape_of


def measure(
    vertices: Tensor,
    topology: Topology,
    surface: ReadSurface,
    spacing: float,
    indices: Tensor,
    creases: MeshCreases,
    chosen: Tensor | None = None,
) -> dict[str, Any]:
    """The report of :func:`principal_quads`: see there.

    Args:
        vertices: of the mesh that was made.
        topology: of that mesh.
        surface: that it was made from.
        spacing: that was asked for.
        indices: of the singular points.
        creases: of the mesh.
        chosen: (I,) bool: the inner edges that are to follow directions, all by default.
    """
    reference = surface.reference
    frames, directions = surface.frames, surface.directions
    angles = np.degrees(angles_to_directions(vertices, topology, reference, frames, directions, spacing, chosen))
    sizes = topology.face_sizes
    deviation = planarity(vertices, topology)
    lengths = edge_lengths(vertices, topology)
    mean_edge = float(lengths.mean())
    variation = float(NormalVariation(topology)(vertices))
    curvature = surface.total_absolute_curvature
    middles = torch.cat([face_centres(vertices, topology), vertices[topology.edges].mean(1)])
    shape = shape_of(topology)
    return {
        "vertices": topology.num_vertices,
        "faces": topology.num_faces,
        "quads": int((sizes == 4).sum()),
        "angle_mean_degrees": float(angles.mean()) if len(angles) else None,
        "angle_95_degrees": float(np.percentile(angles, 95)) if len(angles) else None,
        "planarity_mean": float(deviation.mean()),
        "planarity_max": float(deviation.max()),
        "normal_variation": variation,
        "total_absolute_curvature": curvature,
        "variation_over_curvature": variation / curvature if curvature > 1e-9 * mean_edge else None,
        "distance_max": float(reference.closest(middles).distances.max()) / mean_edge,
        "shortest_edge": float(lengths.min()) / mean_edge,
        "smallest_angle_degrees": math.degrees(float(corner_angles(vertices, topology).min())),
        "smallest_curve_face": _smallest_at_curves(vertices, topology, creases),
        "crease_edges": len(creases.edges),
        "crease_distance_max": creases.distance(vertices) / mean_edge,
        "mean_edge": mean_edge,
        "spacing": spacing,
        "singular": _counts(indices),
        "total_index": math.fsum(indices.tolist()),
        "euler_number": shape.euler_number,
        "boundary_loops": shape.boundary_loops,
        "components": shape.components,
    }


def _smallest_at_curves(vertices: Tensor, topology: Topology, creases: MeshCreases) -> float | None:
    """Area of the smallest face with a vertex on the boundary or a crease, over the mean of all; None without any."""
    on_curve = topology.is_boundary_vertex.clone()
    on_curve[creases.edges.flatten()] = True
    areas, faces = face_areas(vertices, topology), topology.corner_faces[on_curve[topology.corners]]
    return float(areas[faces].min() / areas.mean()) if len(faces) else None


def _counts(indices: Tensor) -> dict[str, int]:
    values, counts = torch.unique(indices, return_counts=True)
    return {f"{value:g}": count for value, count in zip(values.tolist(), counts.tolist(), strict=True)}


def measure_mesh_on(vertices: Tensor, mesh: QuadMesh) -> dict[str, Any]:
    """The report of a principal mesh whose vertices have moved, against the surface that it was made from.

    Args:
        vertices: (V, 3) where they are now.
        mesh: as it was made.

    Raises:
        ShapeError: if the vertices do not fit the mesh.
    """
    points, topology = one_mesh(vertices, mesh.topology).cpu().double(), mesh.topology.to("cpu")
    indices, creases = mesh.singular_indices.cpu().double(), mesh.creases.to(points)
    asked = {name: mesh.report[name] for name in ASKED if name in mesh.report}
    return {**measure(points, topology, mesh.surface, mesh.report["spacing"], indices, creases), **asked}
