"""One mesh, shaded."""

from __future__ import annotations

import os

from torch import Tensor

from .._one_mesh import one_mesh
from ..topology import Topology
from .camera import fit_camera
from .lines import EdgeStyle
from .render import MeshView
from .shading import shade_faces
from .sheet import Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import quiet_edges


def picture_mesh(
    path: str | os.PathLike[str],
    vertices: Tensor,
    topology: Topology,
    title: str = "",
    *,
    face_colors: Tensor | None = None,
    vertex_colors: Tensor | None = None,
    edges: EdgeStyle | None = None,
    view: ViewDirection | None = None,
    width: int = 1200,
    height: int | None = None,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of one mesh, flat shaded, with thin edges.

    Args:
        path: the PNG file.
        vertices: positions ``(V, 3)``.
        topology: connectivity.
        title: words on top; none by default.
        face_colors: ``(F, 3)`` colours in white light; by default grey, the reverse side sand.
        vertex_colors: ``(V, 3)`` colours blended across the faces, instead of face colours; drawn without shading, so
            that they can be read off a colour bar.
        edges: how to draw edges; by default thin and dark. Not with vertex colours.
        view: where to look from; by default :func:`view_direction`.
        width: columns of pixels of the file.
        height: rows of pixels, title not counted; by default as the mesh needs.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    vertices = one_mesh(vertices, topology)
    towards_eye, up = view or view_direction(vertices, topology)
    camera, size = fit_camera(vertices, towards_eye=towards_eye, up=up, width=width, height=height)
    mesh = MeshView(vertices, topology, camera, size)
    if vertex_colors is not None:
        picture = mesh.paint_vertices(vertex_colors)
    else:
        colors = shade_faces(vertices, topology, camera, face_colors)
        picture = mesh.paint(colors, edges=edges or quiet_edges(mesh))
    sheet = Sheet(width, size[0], title)
    sheet.image(picture, 0, sheet.top)
    return sheet.write(path, overwrite=overwrite)
