"""Where a surface bends: absolute curvature in colours."""

from __future__ import annotations

import os
from collections.abc import Sequence

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..energies import total_absolute_curvature_per_vertex
from ..errors import ShapeError
from ..geometry import vertex_areas
from ..topology import Topology
from .camera import fit_camera
from .captions import four_digits, literal
from .color_scale import BAR, ColorScale
from .render import MeshView
from .shading import shade_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import quiet_edges

_SECOND_LINE = 34  # rows of pixels from one line of words above a mesh to the next


def picture_curvature(
    path: str | os.PathLike[str],
    meshes: Sequence[tuple[str, Tensor, Topology]],
    title: str = "",
    *,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of meshes side by side: flat shaded above, ``|k1| + |k2|`` in colours below (paper Fig. 21).

    White is flat. Camera and colour scale are common to all; the scale ends as in :func:`picture_edges`. The
    curvature of a vertex is that of its star over its area, boundary vertices as their neighbours; captions
    give C with the boundary extrapolated, as the colours show it; what jobs report as C has an open boundary.

    Args:
        path: the PNG file.
        meshes: captions, positions ``(V, 3)`` and connectivity.
        title: words on top; none by default.
        view: where to look from; by default :func:`view_direction` of the last mesh.
        width: columns of pixels of the file; the number of rows follows from the meshes.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if there are no meshes, or positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    if not meshes:
        raise ShapeError("meshes", "at least one", "none")
    vertices = [one_mesh(v, t) for _, v, t in meshes]
    topologies = [topology for *_, topology in meshes]
    stars = [
        total_absolute_curvature_per_vertex(v, t, boundary="extrapolated")
        for v, t in zip(vertices, topologies, strict=True)
    ]
    areas = [vertex_areas(v, t) for v, t in zip(vertices, topologies, strict=True)]
    values = [star / torch.where(area > 0, area, 1.0) for star, area in zip(stars, areas, strict=True)]
    scale = ColorScale.of(torch.cat(values), r"$|\kappa_1| + |\kappa_2|$", color_map="Blues", lightest=0.0)
    panel = (width - 2 * MARGIN - BAR - (len(meshes) - 1) * GAP) // len(meshes)
    towards_eye, up = view or view_direction(vertices[-1], topologies[-1])
    camera, size = fit_camera(*vertices, towards_eye=towards_eye, up=up, width=panel)

    words = CAPTION + _SECOND_LINE
    row = words + size[0]
    sheet = Sheet(width, row + size[0] + MARGIN, title)
    for column, (name, *_) in enumerate(meshes):
        left, top = MARGIN + column * (panel + GAP), sheet.top
        mesh = MeshView(vertices[column], topologies[column], camera, size)
        total = float(stars[column].sum())
        sheet.caption(literal(name), left, top, panel)
        sheet.caption(f"$C$ = {four_digits(total)}, boundary extrapolated", left, top + _SECOND_LINE, panel)
        daylight, colors = _panels(mesh, scale.colors(values[column]))
        sheet.image(daylight, left, top + words)
        sheet.image(colors, left, top + row)
    scale.draw_bar(sheet, row + size[0])
    return sheet.write(path, overwrite=overwrite)


def _panels(mesh: MeshView, colors: Tensor) -> tuple[Tensor, Tensor]:
    daylight = mesh.paint(shade_faces(mesh.vertices, mesh.topology, mesh.camera), edges=quiet_edges(mesh))
    if not mesh.topology.num_faces:
        return daylight, daylight
    shades = 0.9 + 0.1 * shade_faces(mesh.vertices, mesh.topology, mesh.camera, mesh.vertices.new_ones(3)).mean(1)
    return daylight, mesh.paint_vertices(colors, face_shades=shades)
