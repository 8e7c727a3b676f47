"""Meshes with their principal edges highlighted."""

from __future__ import annotations

import os
from collections.abc import Mapping

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..errors import ShapeError
from ..principal import PrincipalEdges
from .camera import fit_camera
from .lines import EdgeStyle
from .render import MeshView
from .shading import FRONT, shade_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import line_width

_PRINCIPAL, _OTHER = (0.75, 0.22, 0.17), (0.45, 0.49, 0.56)


def picture_principal_edges(
    path: str | os.PathLike[str],
    meshes: Mapping[str, tuple[Tensor, PrincipalEdges]],
    title: str = "",
    *,
    columns: int = 2,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of meshes side by side, principal edges red and strong, others grey and thin (paper Fig. 5).

    Args:
        path: the PNG file.
        meshes: captions; positions ``(V, 3)`` and principal edges. One camera shows all.
        title: words on top; none by default.
        columns: pictures in a row.
        view: where to look from; by default :func:`view_direction` of the first mesh.
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
    shown = [(name, one_mesh(vertices, edges.topology), edges) for name, (vertices, edges) in meshes.items()]
    columns = min(columns, len(shown))
    panel = (width - 2 * MARGIN - (columns - 1) * GAP) // columns
    towards_eye, up = view or view_direction(shown[0][1], shown[0][2].topology)
    camera, size = fit_camera(*(vertices for _, vertices, _ in shown), towards_eye=towards_eye, up=up, width=panel)
    row = CAPTION + size[0]
    sheet = Sheet(width, -(-len(shown) // columns) * row + MARGIN, title)
    for number, (name, vertices, edges) in enumerate(shown):
        left = MARGIN + (number % columns) * (panel + GAP)
        top = sheet.top + (number // columns) * row
        sheet.caption(name, left, top, panel)
        sheet.image(_panel(MeshView(vertices, edges.topology, camera, size), edges), left, top + CAPTION)
    return sheet.write(path, overwrite=overwrite)


def _panel(mesh: MeshView, edges: PrincipalEdges) -> Tensor:
    vertices = mesh.vertices
    mask = edges.mask.to(vertices.device)
    colors = torch.where(mask[:, None], vertices.new_tensor(_PRINCIPAL), vertices.new_tensor(_OTHER))
    thin = line_width(mesh, 0.04, 0.35, 1.0)
    widths = torch.where(mask, 2.6 * thin, thin)
    faces = shade_faces(vertices, mesh.topology, mesh.camera, vertices.new_tensor(FRONT))
    return mesh.paint(faces, edges=EdgeStyle(colors, widths, mask.to(vertices.dtype)))
