"""Triangle meshes with principal edges, to start principal-symmetric meshes from."""

from __future__ import annotations

import torch
from torch import Tensor

from ..principal import PrincipalEdges
from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .components import read_surface, spacing_of
from .lattice_rows import RowLattice
from .report import measure
from .row_distances import row_distance
from .row_edges import row_mask
from .triangle_mesh import TriangleMesh
from .verification import verified_topology


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
    equilateral triangles where that brings E nearer to C: all by one ratio, or with ``settings.adaptive`` each by the
    curvatures in its place, with edges in proportion to ``1 / sqrt|k|`` for the larger one k.

    Once they are laid, vertices inside move along the surface until rows turn to the directions there, and corners of
    triangles that are turned over, as on the ends of long ellipsoids, between their neighbours. Rows along the other
    curvature are taken where some would stay turned over or E would be higher for that; a note says so, and where
    triangles still are.

    Args:
        vertices: (V, 3) positions of the surface, any length unit.
        topology: its connectivity; polygons are cut into triangles.
        count: how many triangles, about.
        spacing: length of principal edges, in place of a count.
        settings: :class:`MeshingSettings`, by default those.

    Returns:
        The mesh with its principal edges. Its report is that of :func:`principal_quads`, with angles between principal
        edges and principal directions, and ``row_distance``, over the spacing (that of the whole surface).

    Raises:
        ShapeError, SettingsError, MeshError: as :func:`principal_quads`.

    Example:
        >>> from torchfair.meshing import principal_triangles
        >>> from torchfair.shapes import Torus, irregular_triangles
        >>> surface = irregular_triangles(Torus(), 800)
        >>> mesh = principal_triangles(surface.vertices, surface.topology, count=600)
        >>> mesh.topology.valences.unique().tolist(), len(mesh.principal.exceptions)
        ([6], 0)
    """
    chosen = settings or MeshingSettings()
    surface = read_surface(vertices, topology, chosen, count)
    ratio = row_distance(surface.frames, surface.directions)
    size = spacing_of(surface, ratio / 2, count, spacing)
    pieces, size = RowLattice(surface, ratio, size, count, chosen).laid()
    positions = torch.from_numpy(pieces.positions)
    made = verified_topology(pieces.faces, len(positions), surface.shape)
    principal = PrincipalEdges(made, row_mask(made, pieces.rows))
    followed = principal.mask[: made.num_interior_edges]
    report = measure(positions, made, surface, size, pieces.indices, pieces.creases, followed)
    if vertices.device.type != "cpu":
        made = made.to(vertices.device)
        principal = PrincipalEdges(made, principal.mask.to(vertices.device))
    return TriangleMesh(
        positions.to(vertices),
        principal,
        pieces.places.to(vertices),
        pieces.indices.to(vertices),
        pieces.creases.to(vertices),
        {**report, "row_distance": ratio, **(pieces.sizes.report(size) if pieces.sizes else {})},
        [*surface.notes, *pieces.notes],
    )
