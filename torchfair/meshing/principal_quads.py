"""Quad meshes whose edges follow principal curvature lines."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .alignment import aligned
from .components import on_surface, read_surface, spacing_of
from .counts import mesh_to_count
from .curvature_sizes import CurvatureSizes, curvature_sizes
from .lattice import SQUARES
from .quad_mesh import QuadMesh
from .report import measure
from .turned_over import told, turned_over
from .verification import verified_topology


def principal_quads(
    vertices: Tensor,
    topology: Topology,
    *,
    count: int | None = None,
    spacing: float | None = None,
    settings: MeshingSettings | None = None,
) -> QuadMesh:
    """A quad mesh of a surface whose edges follow its principal curvature lines.

    Its vertices lie on a smooth surface through those given. Inside all faces are quads, which meet in fours but for
    the singular points of the principal directions; at the boundary cells are clipped to polygons, and where their
    short edges collapse, neighbours that touch it in a vertex, or nearly, are triangles or pentagons. Euler number,
    boundary loops, components and orientation are those of the surface. Components are meshed one by one with the same
    spacing.

    Quads along principal directions are nearly planar, and have the least E of all: that of edges across an absolute
    curvature is its integral, so that E is the total absolute curvature C (section 4 of the paper).

    With ``settings.adaptive`` edges across a curvature k have lengths in proportion to ``1 / sqrt|k|``, so that all are
    about as far off the surface; the longest at most ``settings.spacing_range`` times as long as the shortest. Where
    lines diverge or converge too much for that, they go on along the directions.

    Args:
        vertices: (V, 3) positions of the surface, any length unit.
        topology: its connectivity; polygons are cut into triangles.
        count: how many faces, about.
        spacing: length of edges, in place of a count.
        settings: :class:`MeshingSettings`, by default those.

    Returns:
        The mesh. Its report has ``angle_mean_degrees`` and ``angle_95_degrees`` between inner edges and
        principal directions (None where the principal curvatures differ by less than 0.02 over the spacing),
        ``planarity_mean`` and ``planarity_max``
        (:func:`torchfair.geometry.planarity`), ``normal_variation`` (E), ``total_absolute_curvature`` (C, of
        the smooth surface through the vertices, with ``l l*`` of creases) and their ratio
        ``variation_over_curvature`` (None for flat surfaces), ``distance_max`` of the middles of edges and
        faces from the surface in mean edges, ``shortest_edge`` in mean edges, ``smallest_angle_degrees`` at
        corners, ``smallest_curve_face``, the area of the smallest face at the boundary and at creases over the mean
        (None if there are none), ``singular`` points by index, ``total_index``, and sizes.
        Adaptive meshes have ``spacing_shortest`` and ``spacing_longest``, as asked for, and ``range_share``, the share
        of the area where curvature asks for a length out of the range.

    Raises:
        ShapeError: if ``vertices`` is not one mesh that fits.
        SettingsError: if neither or both of count and spacing are given, or one is out of range.
        MeshError: if the surface has no faces, faces without area, or more components than faces asked for because
            edges at one place are not welded; :class:`NoMeshError` if no valid mesh was found, with the place.

    Example:
        >>> from torchfair.meshing import principal_quads
        >>> from torchfair.shapes import Torus, irregular_triangles
        >>> surface = irregular_triangles(Torus(), 800)
        >>> mesh = principal_quads(surface.vertices, surface.topology, count=300)
        >>> mesh.topology.is_quadrangular, mesh.report["singular"]
        (True, {})
    """
    chosen = settings or MeshingSettings()
    surface = read_surface(vertices, topology, chosen, count)
    size = spacing_of(surface, SQUARES.cell, count, spacing)
    lattices = [SQUARES] * len(surface.parts)

    def sizing(at: float) -> CurvatureSizes:
        return curvature_sizes(surface.smooth_frames, surface.directions, at, chosen.spacing_range)

    laid = replace(surface, sizing=sizing) if chosen.adaptive else surface
    pieces, size = mesh_to_count(laid, lattices, size, chosen, count, lambda made: len(made.faces))
    if not (chosen.adaptive and chosen.spacing_range > 1):
        pieces = aligned(pieces, surface, size, chosen)
    pieces = on_surface(pieces, surface, chosen)
    over = turned_over(pieces, surface)
    notes = [told(pieces, over, "face", "triangles")] if len(over) else []
    faces, positions = pieces.faces, torch.from_numpy(pieces.positions)
    made = verified_topology(faces, len(positions), surface.shape)
    report = measure(positions, made, surface, size, pieces.indices, pieces.creases)
    return QuadMesh(
        positions.to(vertices),
        made.to(vertices.device),
        pieces.places.to(vertices),
        pieces.indices.to(vertices),
        surface,
        pieces.creases.to(vertices),
        {**report, **(pieces.sizes.report(size) if pieces.sizes else {})},
        [*surface.notes, *pieces.notes, *notes],
    )
