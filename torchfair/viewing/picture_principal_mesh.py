"""A mesh along principal directions: where they are singular, and how planar its faces are."""

from __future__ import annotations

import os

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..geometry import planarity
from ..topology import Topology
from .camera import fit_camera
from .color_scale import BAR, ColorScale
from .legend import Entry, draw_legends
from .render import MeshView
from .shading import FRONT, shade_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import quiet_edges

_FEWER, _MORE = (0.80, 0.26, 0.20), (0.18, 0.42, 0.70)  # faces that meet, than at other vertices


def picture_principal_mesh(
    path: str | os.PathLike[str],
    vertices: Tensor,
    topology: Topology,
    singular_points: Tensor,
    singular_indices: Tensor,
    title: str = "",
    *,
    creases: Tensor | None = None,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of a mesh twice: singular points, and how far its faces are from planar.

    On the left the faces at singular points are red where fewer meet than elsewhere (positive index), blue where more
    do. On the right every face is as dark as it is far from planar (:func:`torchfair.geometry.planarity`).

    Args:
        path: the PNG file.
        vertices: positions ``(V, 3)``.
        topology: connectivity.
        singular_points: ``(n, 3)``, such as of :class:`torchfair.meshing.QuadMesh`.
        singular_indices: ``(n,)`` their indices.
        title: words on top; none by default.
        creases: ``(n, 2)`` vertices of the edges along creases, which are drawn stronger; none by default.
        view: where to look from; by default :func:`view_direction`.
        width: columns of pixels of the file.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    vertices = one_mesh(vertices, topology)
    deviation = planarity(vertices, topology)
    scale = ColorScale.of(deviation, "planarity", color_map="YlGnBu", lightest=0.04)
    panel = (width - 2 * MARGIN - BAR - GAP) // 2
    towards_eye, up = view or view_direction(vertices, topology)
    camera, size = fit_camera(vertices, towards_eye=towards_eye, up=up, width=panel)
    mesh = MeshView(vertices, topology, camera, size)
    found = [(1, _FEWER, "fewer faces meet"), (-1, _MORE, "more faces meet")]
    counts = [(int((torch.sign(singular_indices) == sign).sum()), color, words) for sign, color, words in found]
    legend = [Entry(f"{words} than elsewhere: {n}", color) for n, color, words in counts if n]
    sheet = Sheet(width, (2 if legend else 1) * CAPTION + size[0] + MARGIN, title)
    columns = (
        (f"{len(singular_points)} singular points", _marked(vertices, topology, singular_points, singular_indices)),
        (f"planarity: mean {float(deviation.mean()):.2g}, max {float(deviation.max()):.2g}", scale.colors(deviation)),
    )
    for number, (words, colors) in enumerate(columns):
        left = MARGIN + number * (panel + GAP)
        sheet.caption(words, left, sheet.top, panel)
        painted = mesh.paint(
            shade_faces(vertices, topology, camera, colors.to(vertices)), edges=quiet_edges(mesh, creases)
        )
        sheet.image(painted, left, sheet.top + CAPTION)
    scale.draw_bar(sheet, CAPTION + size[0])
    if legend:
        draw_legends(sheet, [legend], [MARGIN], sheet.top + CAPTION + size[0], panel)
    return sheet.write(path, overwrite=overwrite)


def _marked(vertices: Tensor, topology: Topology, points: Tensor, indices: Tensor) -> Tensor:
    """(F, 3) colours of faces."""
    colors = torch.tensor(FRONT, dtype=vertices.dtype, device=vertices.device).repeat(topology.num_faces, 1)
    for point, index in zip(points.to(vertices), indices.tolist(), strict=True):
        nearest = (vertices - point).square().sum(1).argmin()
        faces = topology.corner_faces[topology.corners == nearest]
        colors[faces] = colors.new_tensor(_FEWER if index > 0 else _MORE)
    return colors
