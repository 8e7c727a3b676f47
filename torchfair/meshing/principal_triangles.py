"""Triangle meshes with principal edges, to start principal-symmetric meshes from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from .._graph import edge_numbers
from ..fields import Directions
from ..fields.frames import FaceFrames, Floats
from ..principal import PrincipalEdges
from ..topology import Topology
from .components import Pieces, mesh_to_count, on_surface, read_surface, spacing_of
from .cut_cells import cut_cells
from .lattice import triangle_lattice
from .report import measure
from .settings import MeshingSettings
from .triangle_mesh import TriangleMesh
from .verification import verified_topology

_EQUILATERAL = math.sqrt(3) / 2
_MOST = 1.4  # distance of rows over the spacing
_EXCESS = 0.15  # of E over C, where K is negative


def principal_triangles(
    vertices: Tensor,
    topology: Topology,
    *,
    count: int | None = None,
    spacing: float | None = None,
    settings: MeshingSettings | None = None,
) -> TriangleMesh:
    r"""A lattice of triangles of which one edge in three follows principal curvature lines.

    Its vertices lie on a smooth surface through those given, in rows along principal curvature lines, each shifted by
    half an edge against the next; inside all have valence 6 but for singular points of index 1/2 (valence 3) and -1/2
    (valence 9). It is what :func:`torchfair.formfinding.principal_symmetric` starts from.

    Rows follow the principal curvature a that is smaller where K is negative. There triangles with edges 2p along rows
    that are q apart have E per area ``|a| + |b| + 2 |a| p^2 / q^2``, so rows are laid farther apart than those of
    equilateral triangles where that brings E nearer to C.

    Args:
        vertices: (V, 3) positions of the surface, any length unit.
        topology: its connectivity; polygons are cut into triangles.
        count: how many triangles, about.
        spacing: length of principal edges, in place of a count.
        settings: :class:`MeshingSettings`, by default those.

    Returns:
        The mesh with its principal edges. Its report is that of :func:`principal_quads`, with angles between principal
        edges and principal directions, and ``row_distance``, over the spacing.

    Raises:
        ShapeError, SettingsError, MeshError: as :func:`principal_quads`.

    Example:
        >>> from torchfair.shapes import Torus, irregular_triangles
        >>> surface = irregular_triangles(Torus(), 800)
        >>> mesh = principal_triangles(surface.vertices, surface.topology, count=600)
        >>> mesh.topology.valences.unique().tolist(), len(mesh.principal.exceptions)
        ([6], 0)
    """
    chosen = settings or MeshingSettings()
    surface = read_surface(vertices, topology, chosen)
    ratio = _row_distance(surface.frames, surface.directions)
    lattices = [triangle_lattice(ratio)] * len(surface.parts)
    size = spacing_of(surface, ratio / 2, count, spacing)
    across = _rows_across(surface.frames, surface.directions)
    turned = replace(surface, fields=[of.turned for of in surface.fields]) if across else surface
    pieces, size = mesh_to_count(turned, lattices, size, chosen, count, _triangles)
    triangles = cut_cells(pieces.positions, pieces.faces, pieces.rows)
    pieces = on_surface(pieces, surface, chosen)
    positions = torch.from_numpy(pieces.positions)
    made = verified_topology(triangles, len(positions), surface.shape)
    principal = PrincipalEdges(made, _mask(made, pieces.rows))
    report = measure(positions, made, surface, size, pieces.indices, principal.mask[: made.num_interior_edges])
    if vertices.device.type != "cpu":
        made = made.to(vertices.device)
        principal = PrincipalEdges(made, principal.mask.to(vertices.device))
    return TriangleMesh(
        positions.to(vertices),
        principal,
        pieces.places.to(vertices),
        pieces.indices.to(vertices),
        {**report, "row_distance": ratio},
        [*surface.notes, *pieces.notes],
    )


def _triangles(pieces: Pieces) -> int:
    return sum(len(face) - 2 for face in pieces.faces)


def _curvatures(frames: FaceFrames, directions: Directions) -> tuple[Floats, Floats]:
    """Integrals of the sizes of the larger and of the smaller curvature (with signs) over negative K, or over all."""
    difference = np.abs(directions.values)
    larger, smaller = directions.means + difference, directions.means - difference
    saddle = larger * smaller < 0
    where = frames.areas * (saddle if saddle.any() else True)
    return np.asarray(where @ np.abs(larger)), np.asarray(where @ np.abs(smaller))


def _rows_across(frames: FaceFrames, directions: Directions) -> bool:
    """Whether rows follow the direction of the smaller curvature (with signs), not of the larger."""
    larger, smaller = _curvatures(frames, directions)
    return bool(smaller < larger)


def _row_distance(frames: FaceFrames, directions: Directions) -> float:
    """Distance of rows over the spacing: E exceeds C by ``|a| / (2 ratio^2)`` where K is negative."""
    larger, smaller = _curvatures(frames, directions)
    total = float(larger + smaller)
    if total <= 0:
        return _EQUILATERAL
    share = float(min(larger, smaller)) / total
    return min(max(math.sqrt(share / (2 * _EXCESS)), _EQUILATERAL), _MOST)


def _mask(topology: Topology, rows: set[tuple[int, int]]) -> Tensor:
    mask = torch.zeros(topology.num_edges, dtype=torch.bool)
    found = edge_numbers(topology, torch.tensor(sorted(rows), dtype=torch.int64).reshape(-1, 2))
    mask[found[found >= 0]] = True
    return mask
