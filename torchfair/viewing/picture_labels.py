"""A mesh with numbers at its vertices."""

from __future__ import annotations

import os
from collections.abc import Sequence

import torch
from torch import Tensor

from .._names import FROM_ZERO, Names
from .._one_mesh import one_mesh
from ..energies import angle_variation_per_edge
from ..topology import Topology
from .camera import fit_camera
from .render import MeshView
from .shading import shade_faces
from .sheet import CAPTION, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import quiet_edges

FEW = 200
"""Vertices up to which all have their numbers."""
_WORST = 20  # edges whose ends have numbers in larger meshes
_SIZE = 19.0
_REACH = 3  # samples around a vertex within which a face of it must be seen


def picture_labels(
    path: str | os.PathLike[str],
    vertices: Tensor,
    topology: Topology,
    chosen: Sequence[int] | None = None,
    title: str = "",
    *,
    names: Names = FROM_ZERO,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of one mesh, shaded, with the numbers of the vertices that can be seen.

    Args:
        path: the PNG file.
        vertices: positions ``(V, 3)``.
        topology: connectivity.
        chosen: vertices with numbers; by default all if they are at most 200, else the ends of the worst edges.
        title: words on top; none by default.
        names: what vertices are called, such as ``names`` of a mesh that was read.
        view: where to look from; by default :func:`view_direction`.
        width: columns of pixels of the file; the number of rows follows from the mesh.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    vertices = one_mesh(vertices, topology)
    numbers = _chosen(vertices, topology) if chosen is None else torch.tensor(list(chosen), dtype=torch.int64)
    towards_eye, up = view or view_direction(vertices, topology)
    camera, size = fit_camera(vertices, towards_eye=towards_eye, up=up, width=width - 2 * MARGIN)
    mesh = MeshView(vertices, topology, camera, size)
    sheet = Sheet(width, size[0] + CAPTION + MARGIN, title)
    part = "all vertices" if len(numbers) == int((topology.valences > 0).sum()) else f"{len(numbers)} vertices"
    sheet.caption(f"numbers of {part} as in the file, from {names.first}", MARGIN, sheet.top, width - 2 * MARGIN)
    top = sheet.top + CAPTION
    sheet.image(mesh.paint(shade_faces(vertices, topology, camera), edges=quiet_edges(mesh)), MARGIN, top)
    for vertex in numbers[_seen(mesh, numbers)].tolist():
        x, y = (mesh.points[vertex, :2] / mesh.supersampling).tolist()
        sheet.label(names.vertex(vertex), MARGIN + x, top + y, _SIZE)
    return sheet.write(path, overwrite=overwrite)


def _chosen(vertices: Tensor, topology: Topology) -> Tensor:
    """All vertices of faces, if they are few; else the ends of the worst edges."""
    used = (topology.valences > 0).nonzero().squeeze(1)
    if len(used) <= FEW or not topology.num_interior_edges:
        return used[:FEW].cpu()
    order = angle_variation_per_edge(vertices, topology).argsort(descending=True, stable=True)[:_WORST]
    ends: Tensor = torch.unique(topology.interior_edges[order])
    return ends.cpu()


def _seen(mesh: MeshView, numbers: Tensor) -> Tensor:
    """(n,) bool: whether a face of each vertex is seen right beside it."""
    faces, topology = mesh.face_index, mesh.topology
    rows, columns = faces.shape
    steps = torch.arange(-_REACH, _REACH + 1)
    places = mesh.points[numbers, :2].floor().to(torch.int64)
    x = (places[:, 0, None, None] + steps).clamp(0, columns - 1).expand(-1, len(steps), -1)
    y = (places[:, 1, None, None] + steps[:, None]).clamp(0, rows - 1).expand(-1, -1, len(steps))
    around = faces[y, x].flatten(1).to(torch.int64)
    keys = torch.unique(topology.corner_faces * topology.num_vertices + topology.corners)
    beside = torch.where(around >= 0, around * topology.num_vertices + numbers[:, None], -1)
    return torch.isin(beside, keys).any(1)
