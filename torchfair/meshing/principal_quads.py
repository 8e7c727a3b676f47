"""Quad meshes whose edges follow principal curvature lines."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from .._numbers import check_count, check_number
from ..errors import SettingsError
from ..fields import Directions, FaceFrames
from ..topology import Topology
from .attempt import PieceMesh
from .ladder import mesh_component
from .lattice import SQUARES, Lattice
from .quad_mesh import QuadMesh
from .report import measure
from .settings import MeshingSettings
from .surface import DesignSurface, components_of
from .verification import shape_of, verified_topology


def principal_quads(
    vertices: Tensor,
    topology: Topology,
    *,
    count: int | None = None,
    spacing: float | None = None,
    settings: MeshingSettings | None = None,
) -> QuadMesh:
    """A quad mesh of a surface whose edges follow its principal curvature lines.

    Its vertices lie on the surface. Inside all faces are quads, which meet in fours but for the singular points of the
    principal directions; at the boundary cells are clipped to polygons. Euler number, boundary loops, components and
    orientation are those of the surface. Components are meshed one by one with the same spacing.

    Quads along principal directions are nearly planar, and have the least E of all: that of edges across an absolute
    curvature is its integral, so that E is the total absolute curvature C (section 4 of the paper).

    Args:
        vertices: (V, 3) positions of the surface, any length unit.
        topology: its connectivity; polygons are cut into triangles.
        count: how many faces, about.
        spacing: length of edges, in place of a count.
        settings: :class:`MeshingSettings`, by default those.

    Returns:
        The mesh. Its report has ``angle_mean_degrees`` and ``angle_95_degrees`` between inner edges and principal
        directions (None where there are none), ``planarity_mean`` and ``planarity_max``
        (:func:`torchfair.geometry.planarity`), ``normal_variation`` (E), ``total_absolute_curvature`` (C, of the
        surface) and their ratio ``variation_over_curvature`` (None for flat surfaces), ``distance_max`` of the middles
        of edges and faces from the surface in mean edges, ``singular`` points by index, ``total_index``, and sizes.

    Raises:
        ShapeError: if ``vertices`` is not one mesh that fits.
        SettingsError: if neither or both of count and spacing are given, or one is out of range.
        MeshError: if the surface has no faces, or faces without area; :class:`NoMeshError` if no valid mesh was
            found, with the place.

    Example:
        >>> from torchfair.shapes import Torus, irregular_triangles
        >>> surface = irregular_triangles(Torus(), 800)
        >>> mesh = principal_quads(surface.vertices, surface.topology, count=300)
        >>> mesh.topology.is_quadrangular, mesh.report["singular"]
        (True, {})
    """
    return mesh_surface(vertices, topology, SQUARES, count, spacing, settings or MeshingSettings())


def mesh_surface(
    vertices: Tensor,
    topology: Topology,
    lattice: Lattice,
    count: int | None,
    spacing: float | None,
    settings: MeshingSettings,
) -> QuadMesh:
    """Quads of a lattice over all components of a surface."""
    parts = components_of(vertices, topology)
    size = _spacing(parts, lattice, count, spacing)
    meshes, notes, fields = [], [], []
    for number, part in enumerate(parts):
        directions, rings = part.directions(settings.noise)
        fields.append(directions)
        smoothing = settings.smoothing_length(rings)
        mesh, words = mesh_component(part, directions, lattice, size, smoothing, settings)
        name = f"component {number + 1}: " if len(parts) > 1 else ""
        if rings > 1 and settings.noise == "auto":
            notes.append(f"{name}the surface is rough: curvature averaged over {rings} rings")
        if words:
            notes.append(f"{name}not as asked for, which gave no valid mesh: {words}")
        meshes.append(mesh)
    return _assemble(vertices, parts, fields, meshes, size, notes)


def _spacing(parts: list[DesignSurface], lattice: Lattice, count: int | None, spacing: float | None) -> float:
    if (count is None) == (spacing is None):
        raise SettingsError("give either count or spacing")
    if spacing is not None:
        check_number("spacing", spacing, above=True, finite=True)
        return float(spacing)
    check_count("count", count, least=1)
    assert count is not None
    area = math.fsum(part.frames.areas.sum() for part in parts)
    return math.sqrt(area / (count * lattice.cell))


def _assemble(
    vertices: Tensor,
    parts: list[DesignSurface],
    fields: list[Directions],
    meshes: list[PieceMesh],
    spacing: float,
    notes: list[str],
) -> QuadMesh:
    """One mesh of those of the components, verified and measured."""
    offsets = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    faces = [
        [node + offset for node in face] for mesh, offset in zip(meshes, offsets, strict=False) for face in mesh.faces
    ]
    positions = torch.from_numpy(np.concatenate([mesh.positions for mesh in meshes]))
    surface, whole = _joined(parts)
    topology = verified_topology(faces, len(positions), shape_of(whole))
    places = torch.from_numpy(np.concatenate([mesh.singular_places for mesh in meshes]))
    indices = torch.from_numpy(np.concatenate([mesh.singular_charges for mesh in meshes])) / 4.0
    directions = Directions(
        np.concatenate([of.values for of in fields]),
        np.concatenate([of.means for of in fields]),
        np.concatenate([of.confidence for of in fields]),
    )
    frames = FaceFrames.of(surface, whole)
    report = measure(positions, topology, (surface, whole), frames, directions, spacing, indices)
    moved = (part.to(vertices) for part in (positions, places, indices))
    points, places, indices = moved
    return QuadMesh(points, topology.to(vertices.device), places, indices, report, notes)


def _joined(parts: list[DesignSurface]) -> tuple[Tensor, Topology]:
    """The triangles of all components in order, so that faces are numbered as their directions."""
    if len(parts) == 1:
        return parts[0].vertices, parts[0].topology
    offset, faces = 0, []
    for part in parts:
        faces.append(part.topology.triangles + offset)
        offset += part.topology.num_vertices
    vertices = torch.cat([part.vertices for part in parts])
    return vertices, Topology.from_faces(torch.cat(faces), len(vertices))
