"""What the job that lowers C reports and promises."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from ...constraints import BoundaryNormals
from ...energies import (
    angle_variation,
    total_frobenius_curvature,
    total_mean_curvature,
)
from ...geometry import corner_angles, edge_lengths, face_normals, vertex_normals
from ...geometry.planarity import planarity
from ...measuring import fold_measures
from ...measuring.trust import LARGEST_DIHEDRAL, explained_variation
from ...settings.form_settings import FormSettings
from ...topology import Topology
from ..job.promises import Promise, handle_promise

_ON_THE_CURVES = 1e-6  # mean edge lengths
_TANGENT = 1.0  # degrees
_NEARLY_PLANAR = 5e-3  # relative planarity


def form_measures(vertices: Tensor, topology: Topology, rim: Tensor, normals: Tensor, away: Tensor) -> dict[str, float]:
    """Energies and conditions of one mesh, in the unit of the input.

    Args:
        vertices: (V, 3).
        topology: Its connectivity.
        rim: (V, 3) the same, with boundary vertices where they should be.
        normals: (V, 3) prescribed unit normals of boundary vertices; zero where none is.
        away: (n,) distances of handles from their targets.

    Returns:
        ``total_absolute_curvature``, ``total_frobenius_curvature``, ``normal_variation``, ``angle_variation``,
        ``total_mean_curvature`` (length), ``energy_over_curvature``, ``area``, ``mean_edge_length``,
        ``smallest_angle_degrees``, ``largest_planarity_of_all`` faces, ``largest_dihedral_angle_degrees``,
        ``folded_faces`` that look away from what surrounds them, ``self_intersections`` (pairs of faces that meet
        without being neighbours), ``largest_tilt_degrees`` between prescribed normals and those at the boundary
        (:class:`BoundaryNormals`), ``largest_boundary_distance`` and ``largest_handle_distance``.
    """
    folds = fold_measures(vertices, topology)
    energy, curvature = folds["normal_variation"], folds["total_absolute_curvature"]
    return {
        "total_absolute_curvature": curvature,
        "total_frobenius_curvature": float(total_frobenius_curvature(vertices, topology)),
        "normal_variation": energy,
        "energy_over_curvature": energy / curvature if curvature > 0.0 else math.nan,
        "angle_variation": float(angle_variation(vertices, topology)),
        "total_mean_curvature": float(total_mean_curvature(vertices, topology)),
        "area": folds["area"],
        "mean_edge_length": float(edge_lengths(vertices, topology).mean()),
        "smallest_angle_degrees": math.degrees(float(corner_angles(vertices, topology).min())),
        "largest_planarity_of_all": float(planarity(vertices, topology).max()),
        "folded_faces": folded_faces(vertices, topology),
        **{name: folds[name] for name in ("largest_dihedral_angle_degrees", "self_intersections")},
        "largest_tilt_degrees": math.degrees(_largest_tilt(vertices, topology, normals)),
        "largest_boundary_distance": float(torch.linalg.vector_norm(vertices - rim, dim=1).max()),
        "largest_handle_distance": float(away.max()) if away.numel() else 0.0,
    }


def form_promises(
    settings: FormSettings,
    before: Mapping[str, float],
    after: Mapping[str, float],
    *,
    handles: bool,
    normals: bool,
    remesh: bool = False,
) -> list[Promise]:
    """What is asked of a mesh, and what its measures are.

    Args:
        settings: Of the job.
        before: Measures of the start.
        after: Measures of the mesh.
        handles: Whether there are any.
        normals: Whether any are prescribed.
        remesh: Whether triangles may be replaced.
    """
    edge, promises = before["mean_edge_length"], []
    if not (handles or normals or before["largest_boundary_distance"] > _ON_THE_CURVES * edge):
        most, reached = before["total_absolute_curvature"], after["total_absolute_curvature"]
        slack = settings.projection.merit_tolerance
        remedy = "start is about as good as any: lower fairness, or keep it"
        promises.append(Promise("C", most, reached, remedy=remedy, slack=slack))
    promises.append(
        Promise("distance of the boundary from its curves", _ON_THE_CURVES * edge, after["largest_boundary_distance"])
    )
    least = min(math.degrees(settings.least_angle), 0.5 * before["smallest_angle_degrees"])
    remedy = "raise fairness, allow more iterations, or start from more even triangles"
    remedy = remedy if remesh else f"let triangles be replaced (remesh), {remedy}"
    promises.append(
        Promise("smallest angle", least, after["smallest_angle_degrees"], "at least", "degrees", remedy=remedy)
    )
    promises.append(Promise("folded faces", before["folded_faces"], after["folded_faces"], remedy=remedy))
    promises += fold_promises(after)
    if normals:
        remedy = "the mesh is too coarse there: ask for another level"
        tilt = after["largest_tilt_degrees"]
        promises.append(Promise("angle to a prescribed tangent plane", _TANGENT, tilt, unit="degrees", remedy=remedy))
    if handles:
        remedy = "pull less, or allow more iterations"
        promises.append(handle_promise(after["largest_handle_distance"], edge, remedy=remedy))
    return promises


def warp_notes(before: Mapping[str, float], after: Mapping[str, float]) -> list[str]:
    """Says that faces were nearly planar and no longer are, in measures of both: C does not ask for that."""
    had, have = before["largest_planarity_of_all"], after["largest_planarity_of_all"]
    if not (had < _NEARLY_PLANAR < have):
        return []
    words = f"faces were planar within {had:.2g} of their edges and are warped by up to {have:.2g} now: C is lowered "
    return [f"{words}on triangles, whatever becomes of faces; torchfair fair --planar quads makes them planar again"]


def fold_promises(after: Mapping[str, float]) -> list[Promise]:
    """What C does not see: bending within a star cancels, and a mesh folded flat measures C = 0.

    Args:
        after: Those of :func:`~torchfair.measuring.fold_measures`.
    """
    remedy = "the surface is folded, and its C means nothing: try more starts, other curves, or start from another mesh"
    energy = after["normal_variation"]
    most = explained_variation(after["total_absolute_curvature"], after["area"])
    return [
        Promise("E, which sees folds that C does not,", most, energy, remedy=remedy),
        Promise(
            "largest dihedral angle", LARGEST_DIHEDRAL, after["largest_dihedral_angle_degrees"], unit="degrees",
            remedy=remedy,
        ),
        Promise("pairs of faces that run through each other", 0.0, after["self_intersections"], remedy=remedy),
    ]  # fmt: skip


def folded_faces(vertices: Tensor, topology: Topology) -> int:
    """Faces that are not seen from the side from which the mean normal of their corners is."""
    around = vertex_normals(vertices, topology)[topology.corners]
    along = (around * face_normals(vertices, topology)[topology.corner_faces]).sum(1)
    total = along.new_zeros(topology.num_faces).index_add_(0, topology.corner_faces, along)
    return int((total <= 0.0).sum())


def _largest_tilt(vertices: Tensor, topology: Topology, normals: Tensor) -> float:
    """Largest angle between prescribed normals (V, 3), zero where none, and those of the surface there."""
    chosen = torch.nonzero((normals != 0.0).any(1)).squeeze(1)
    if not chosen.numel():
        return 0.0
    found = BoundaryNormals.of(vertices, topology).at_boundary[chosen]
    sine = torch.linalg.vector_norm(torch.linalg.cross(found, normals[chosen]), dim=1)
    return float(torch.atan2(sine, (found * normals[chosen]).sum(1)).max())
