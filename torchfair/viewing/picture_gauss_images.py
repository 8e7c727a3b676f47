"""Gauss images of a mesh before and after."""

from __future__ import annotations

import os
from collections.abc import Sequence

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..geometry import GaussImage, face_area_vectors, gauss_image
from ..topology import Topology
from .captions import four_digits
from .common_topology import topologies_of
from .sheet import CAPTION, GAP, MARGIN, Sheet, points
from .sphere import draw_arcs, draw_points, draw_sphere, fit_sphere_view
from .view_direction import view_direction


def picture_gauss_images(
    path: str | os.PathLike[str],
    before: Tensor,
    after: Tensor,
    topology: Topology | Sequence[Topology],
    title: str = "",
    *,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of the Gauss images before (left) and after (right) (paper Fig. 12).

    Every face is a dot on the unit sphere, its normal; faces with a common edge are joined by a great-circle arc, as
    long as the dihedral angle. Parts behind the sphere are faint. Both are seen from the same side, the average
    normal if there is a clear one, in the same window: as large as the points need, or the whole sphere.

    Args:
        path: the PNG file.
        before: positions ``(V, 3)``.
        after: positions ``(V, 3)``.
        topology: connectivity of both, or one for each.
        title: words on top; none by default.
        width: columns of pixels of the file; the number of rows follows.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    first, second = topologies_of(2, topology)
    before, after = one_mesh(before, first), one_mesh(after, second)
    images = gauss_image(before, first), gauss_image(after, second)
    towards_eye, up = viewpoint(before, first)
    view = fit_sphere_view(*(image.points for image in images), towards_eye=towards_eye, up=up)
    panel = (width - 2 * MARGIN - GAP) // 2
    sheet = Sheet(width, CAPTION + panel + MARGIN, title)
    sheet.note(f"net: {view.net_step}\N{DEGREE SIGN}", MARGIN, sheet.top)
    for column, (name, image) in enumerate(zip(("before", "after"), images, strict=True)):
        left = MARGIN + column * (panel + GAP)
        strength = min(1.0, (1500 / max(1, len(image.arcs))) ** 0.5)
        total = four_digits(_perimeter(image))
        sheet.caption(f"{name}     arcs in total {total} rad", left, sheet.top, panel)
        axes = sheet.axes(left, sheet.top + CAPTION, panel, panel)
        draw_sphere(axes, view)
        draw_arcs(axes, view, image.points, image.arcs, points(0.8 + 1.0 * strength), 0.4 + 0.5 * strength)
        draw_points(axes, view, image.points, points(1.6 + 4.4 * strength))
    return sheet.write(path, overwrite=overwrite)


def viewpoint(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor]:
    """From where to look at the Gauss image of one mesh ``(V, 3)``: direction to the eye, and what is up."""
    direction = view_direction(vertices, topology)
    area_vectors = face_area_vectors(vertices, topology).to("cpu", torch.float64)
    average = area_vectors.sum(0)
    if torch.linalg.vector_norm(average) > 0.3 * torch.linalg.vector_norm(area_vectors, dim=-1).sum():
        return average, direction.towards_eye
    return direction.towards_eye, direction.up


def _perimeter(image: GaussImage) -> float:
    """Total length of the arcs: the sum of |a| over the interior edges."""
    start, stop = image.points[image.arcs].unbind(1)
    across = torch.linalg.vector_norm(torch.linalg.cross(start, stop), dim=-1)
    return float(torch.atan2(across, (start * stop).sum(-1)).sum())
