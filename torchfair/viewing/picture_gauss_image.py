"""The Gauss image of one mesh, folded parts marked."""

from __future__ import annotations

import os

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..geometry import gauss_image
from ..topology import Topology
from .picture_gauss_images import viewpoint
from .sheet import CAPTION, MARGIN, Sheet, points
from .sphere import draw_arcs, draw_points, draw_sphere, fit_sphere_view

_MOST_ARCS = 60_000
_FOLDED = "#c2185b"


def picture_gauss_image(
    path: str | os.PathLike[str],
    vertices: Tensor,
    topology: Topology,
    crossings: Tensor,
    title: str = "",
    *,
    width: int = 1200,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of the Gauss image; arcs of self-intersecting normal pyramids are red and on top.

    Of meshes with very many edges an evenly spread part of the arcs is drawn, and a note says so.

    Args:
        path: the PNG file.
        vertices: positions ``(V, 3)``.
        topology: connectivity.
        crossings: (V,) see :func:`torchfair.stars.pyramid_self_intersections`.
        title: words on top; none by default.
        width: columns of pixels of the file, which is nearly square.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    vertices = one_mesh(vertices, topology)
    image = gauss_image(vertices, topology)
    towards_eye, up = viewpoint(vertices, topology)
    view = fit_sphere_view(image.points, towards_eye=towards_eye, up=up)
    panel = width - 2 * MARGIN
    sheet = Sheet(width, CAPTION + panel + MARGIN, title)
    step = -(-topology.num_interior_edges // _MOST_ARCS) or 1
    part = f", one arc in {step}" if step > 1 else ""
    sheet.note(f"net: {view.net_step}\N{DEGREE SIGN}{part}", MARGIN, sheet.top)
    folded = (crossings > 0)[topology.interior_edges].any(1).cpu()
    sheet.caption(f"arcs of self-intersecting pyramids: {int(folded.sum())} of {len(folded)}", MARGIN, sheet.top, panel)
    strength = min(1.0, (1500 / max(1, topology.num_interior_edges // step)) ** 0.5)
    axes = sheet.axes(MARGIN, sheet.top + CAPTION, panel, panel)
    draw_sphere(axes, view)
    for mask, color in ((~folded, None), (folded, _FOLDED)):
        arcs = image.arcs.cpu()[mask][::step]
        style = {} if color is None else {"color": color}
        draw_arcs(axes, view, image.points, arcs, points(0.8 + 1.0 * strength), 0.4 + 0.5 * strength, **style)
    used = torch.unique(image.arcs.cpu()[::step]) if step > 1 else slice(None)
    draw_points(axes, view, image.points.cpu()[used], points(1.6 + 4.4 * strength))
    return sheet.write(path, overwrite=overwrite)
