"""Normal pyramids of chosen vertices, drawn on the unit sphere."""

from __future__ import annotations

import os
from collections.abc import Sequence

import torch
from torch import Tensor

from .._names import FROM_ZERO, Names
from .._one_mesh import one_mesh
from ..errors import ShapeError
from ..geometry import face_normals
from ..stars import StarClasses, StarKind
from ..stars.pyramid import pyramid_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet, points
from .sphere import draw_arcs, draw_points, draw_rings, draw_sphere, fit_sphere_view, on_sphere


def picture_pyramids(
    path: str | os.PathLike[str],
    vertices: Tensor,
    classes: StarClasses,
    crossings: Tensor,
    chosen: Sequence[int],
    title: str = "",
    *,
    names: Names = FROM_ZERO,
    columns: int = 3,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG with the normal pyramids of chosen inner vertices (paper Figs. 2 and 4).

    Each is seen from outside along its mean normal, in a window of its own size: the finer the mesh, the smaller
    the pyramids; the net of circles tells how small. Rings mark where a pyramid crosses itself.

    Args:
        path: the PNG file.
        vertices: positions ``(V, 3)``.
        classes: see :func:`torchfair.stars.classify_stars`.
        crossings: (V,) see :func:`torchfair.stars.pyramid_self_intersections`.
        chosen: vertex numbers; a picture without any says so.
        title: words on top; none by default.
        names: what vertices are called in captions, such as ``names`` of a mesh that was read.
        columns: pyramids in a row.
        width: columns of pixels of the file; the number of rows follows.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshError: if a chosen vertex is not inside the mesh.
        MeshFileError: if the file cannot be written.
    """
    if columns < 1:
        raise ShapeError("columns", "at least one", columns)
    topology = classes.topology
    vertices = one_mesh(vertices, topology)
    panel = (width - 2 * MARGIN - (columns - 1) * GAP) // columns
    rows = max(1, -(-len(chosen) // columns))
    sheet = Sheet(width, rows * (2 * CAPTION + panel) + MARGIN if chosen else 3 * CAPTION, title)
    if not chosen:
        sheet.caption("no vertex inside the mesh has a normal pyramid", MARGIN, sheet.top + CAPTION, width - 2 * MARGIN)
    normals = face_normals(vertices, topology)
    for number, vertex in enumerate(chosen):
        left = MARGIN + (number % columns) * (panel + GAP)
        top = sheet.top + (number // columns) * (2 * CAPTION + panel)
        pyramid = normals[pyramid_faces(topology, vertex)]
        _draw(sheet, pyramid, left, top + 2 * CAPTION, panel)
        kind = StarKind(int(classes.kinds[vertex])).name.lower()
        if kind == "saddle":
            kind = "good saddle" if bool(classes.good[vertex]) else "bad saddle"
        pattern = ",".join(map(str, classes.pattern(vertex, ordinary=True)))
        sheet.caption(f"vertex {names.vertex(vertex)}: {kind}", left, top, panel)
        words = f"edges {pattern}" + (f", {int(crossings[vertex])} crossings" if crossings[vertex] else "")
        color = _CROSSING if crossings[vertex] else "#5b6472"
        sheet.text(words, left + panel / 2, top + 1.35 * CAPTION, 21, color, ha="center", va="center")
    return sheet.write(path, overwrite=overwrite)


_CROSSING = "#c2185b"


def arc_crossings(normals: Tensor) -> Tensor:
    """(n, 3) points of the sphere where sides of a closed polygon of unit vectors (k, 3) cross, neighbours left out."""
    index = torch.arange(len(normals))
    first, second = torch.triu_indices(len(normals), len(normals), offset=2)
    beside = (first == 0) & (second == len(normals) - 1)
    first, second = first[~beside], second[~beside]
    a, b, c, d = (normals[i] for i in (first, index.roll(-1)[first], second, index.roll(-1)[second]))
    one, other = torch.linalg.cross(a, b), torch.linalg.cross(c, d)
    meets = torch.linalg.cross(one, other)
    meets = torch.where(((meets * (a + b + c + d)).sum(-1) < 0)[:, None], -meets, meets)

    def between(x: Tensor, y: Tensor, normal: Tensor) -> Tensor:
        before, behind = torch.linalg.cross(x, meets), torch.linalg.cross(meets, y)
        inside: Tensor = ((before * normal).sum(-1) > 0) & ((behind * normal).sum(-1) > 0)
        return inside

    return torch.nn.functional.normalize(meets[between(a, b, one) & between(c, d, other)], dim=-1, eps=1e-300)


def _draw(sheet: Sheet, normals: Tensor, left: int, top: int, size: int) -> None:
    normals = normals.to("cpu", torch.float64)
    mean = on_sphere(normals).sum(0)
    towards_eye = mean if bool(torch.linalg.vector_norm(mean) > 1e-9) else torch.tensor([0.0, 0, 1])
    view = fit_sphere_view(normals, towards_eye=towards_eye, up=torch.tensor([0.0, 1, 0]))
    axes = sheet.axes(left, top, size, size)
    draw_sphere(axes, view)
    index = torch.arange(len(normals))
    draw_arcs(axes, view, normals, torch.stack([index, index.roll(-1)], dim=1), points(3.0))
    draw_points(axes, view, normals, points(9))
    draw_rings(axes, view, arc_crossings(normals), points(22), _CROSSING)
    sheet.note(f"net: {view.net_step}\N{DEGREE SIGN}", left, top - 8)
