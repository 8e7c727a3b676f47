"""What the design of principal-symmetric meshes reports."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...constraints.principal_symmetric import between_stars, star_numbers, star_stencil
from ...constraints.saddle_sides import beyond_tangent_plane, is_negative
from ...energies import normal_variation, total_absolute_curvature
from ...geometry import corner_angles, edge_lengths, face_areas, face_normals
from ...geometry._ops import cross, dot
from ...principal import PrincipalEdges
from ...principal.principal_edges import PrincipalStars
from ...principal.spheres import star_spheres
from ...stars import pyramid_self_intersections
from ...topology import Topology


def condition_residuals(vertices: Tensor, principal: PrincipalEdges, stars: PrincipalStars) -> dict[str, Tensor]:
    """Relative residuals of both conditions, measured from the vertices (V, 3) alone.

    Returns:
        ``cospherical`` (R,): how far the cospherical neighbours of each star are from the sphere that they miss
        alike, over the mean length of the edges to them. ``coplanar`` (n,): for every principal edge between stars
        the determinant of both normals and the edge, over its length: the sine of the angle by which one normal
        leaves the plane of the other and the edge, times that between other normal and edge.

    Example:
        >>> from torchfair.formfinding import condition_residuals
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 6, 12)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> residuals = condition_residuals(mesh.vertices, edges, edges.stars())
        >>> sorted(residuals)
        ['coplanar', 'cospherical']
    """
    spheres = star_spheres(vertices, stars)
    spokes = vertices[stars.cospherical] - vertices[stars.vertices, None]
    lengths = torch.linalg.vector_norm(spokes, dim=2).mean(1)
    edges = between_stars(principal.topology.edges[principal.mask], stars)
    first, second = spheres.normals[star_numbers(edges, stars)].unbind(1)
    along = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    return {
        "cospherical": 0.5 * spheres.misses.abs() / lengths,
        "coplanar": dot(cross(first, second), along).abs() / torch.linalg.vector_norm(along, dim=1),
    }


def symmetric_measures(
    vertices: Tensor, principal: PrincipalEdges, stars: PrincipalStars, handles: Tensor, targets: Tensor
) -> dict[str, float]:
    """Measures of success of ``vertices`` (V, 3) with ``handles`` (n,) at ``targets`` (n, 3), in the unit of the input.

    Returns:
        ``largest_cospherical``, ``mean_cospherical``, ``largest_coplanar``, ``mean_coplanar``: see
        :func:`~torchfair.formfinding.condition_residuals`; 0 without stars. ``stars``: how many. ``negative_stars``:
        those with an angle sum above 2 pi. ``saddle_side_share``: share of them whose principal neighbours lie beyond
        the tangent plane (1 if there are none). ``crossing_pyramids_negative`` and ``crossing_pyramids``: negative
        stars, and all interior vertices, whose normal pyramid intersects itself. ``normal_variation`` (E) and
        ``total_absolute_curvature`` (C) and their quotient ``energy_over_curvature``; ``area``;
        ``mean_edge_length``; ``smallest_angle_degrees``; ``flipped_faces``: those that look the other way than the
        faces beside them; ``largest_handle_distance``.
    """
    topology = principal.topology
    residuals = condition_residuals(vertices, principal, stars)
    x = vertices[star_stencil(stars)]
    negative, right = is_negative(x), beyond_tangent_plane(x)
    crossing = pyramid_self_intersections(vertices, topology) > 0
    energy = float(normal_variation(vertices, topology))
    curvature = float(total_absolute_curvature(vertices, topology))
    away = torch.linalg.vector_norm(vertices[handles] - targets, dim=1)
    angles = corner_angles(vertices, topology)
    count = int(negative.sum())
    return {
        **{f"largest_{name}": float(values.max()) if values.numel() else 0.0 for name, values in residuals.items()},
        **{f"mean_{name}": float(values.mean()) if values.numel() else 0.0 for name, values in residuals.items()},
        "stars": float(stars.vertices.shape[0]),
        "negative_stars": float(count),
        "saddle_side_share": float((right & negative).sum()) / count if count else 1.0,
        "crossing_pyramids_negative": float((crossing[stars.vertices] & negative).sum()),
        "crossing_pyramids": float(crossing.sum()),
        "normal_variation": energy,
        "total_absolute_curvature": curvature,
        "energy_over_curvature": energy / curvature if curvature > 0.0 else math.nan,
        "area": float(face_areas(vertices, topology).sum()),
        "mean_edge_length": float(edge_lengths(vertices, topology).mean()),
        "smallest_angle_degrees": math.degrees(float(angles.min())),
        "flipped_faces": float(_flipped(vertices, topology).sum()),
        "largest_handle_distance": float(away.max()) if away.numel() else 0.0,
    }


def _flipped(vertices: Tensor, topology: Topology) -> Tensor:
    """(F,) bool: faces whose normal points against the sum of those of the faces beside them."""
    normals, pairs = face_normals(vertices, topology), topology.interior_edge_faces
    around = torch.zeros_like(normals)
    for one, other in (pairs.unbind(1), pairs.flip(1).unbind(1)):
        around.index_add_(0, one, normals[other])
    return dot(normals, around) < 0.0
