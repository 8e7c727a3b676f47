"""A mesh with its vertices coloured by what their stars are."""

from __future__ import annotations

import os

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..cameras import Camera, Size
from ..geometry import face_centres
from ..stars import StarClasses, StarKind
from ..topology import Topology
from .camera import fit_camera
from .legend import Entry, draw_legends
from .lines import EdgeStyle
from .render import MeshView
from .shading import shade_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import line_width

_DETAILED = 100_000  # faces up to which every vertex has its own cell
_COLORS = {
    "convex": (0.55, 0.72, 0.92),
    "good saddle": (0.36, 0.75, 0.55),
    "bad saddle": (0.98, 0.75, 0.30),
    "neither": (0.83, 0.28, 0.20),
    "boundary": (0.88, 0.89, 0.91),
}
_PYRAMIDS = {"free of intersections": (0.80, 0.84, 0.89), "self-intersecting": (0.55, 0.10, 0.45)}
_INK = (0.12, 0.15, 0.21)


def picture_star_classes(
    path: str | os.PathLike[str],
    vertices: Tensor,
    classes: StarClasses,
    crossings: Tensor,
    title: str = "",
    *,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of one mesh twice: cells of vertices coloured by class, and by self-intersection of the pyramids.

    The cell of a vertex reaches to the middles of its edges and faces. Meshes of more than 100 000 faces have a
    colour per face instead, that of its worst corner.

    Args:
        path: the PNG file.
        vertices: positions ``(V, 3)``.
        classes: see :func:`torchfair.stars.classify_stars`.
        crossings: (V,) see :func:`torchfair.stars.pyramid_self_intersections`.
        title: words on top; none by default.
        view: where to look from; by default :func:`view_direction`.
        width: columns of pixels of the file; the number of rows follows.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    topology = classes.topology
    vertices = one_mesh(vertices, topology)
    panel = (width - 2 * MARGIN - GAP) // 2
    towards_eye, up = view or view_direction(vertices, topology)
    camera, size = fit_camera(vertices, towards_eye=towards_eye, up=up, width=panel)
    sheet = Sheet(width, 2 * CAPTION + size[0] + MARGIN, title)
    codes = _class_codes(classes)
    boundary = codes == 4
    panels = (
        ("stars", codes, _COLORS),
        ("normal pyramids", torch.where(boundary, 2, (crossings > 0).to(codes)), _PYRAMIDS),
    )
    lefts: list[int] = []
    for column, (name, values, palette) in enumerate(panels):
        left = MARGIN + column * (panel + GAP)
        sheet.caption(name, left, sheet.top, panel)
        colors = torch.tensor([*palette.values(), _COLORS["boundary"]])
        sheet.image(_panel(vertices, topology, camera, size, values, colors), left, sheet.top + CAPTION)
        lefts.append(left)
    legends = [_entries(values, palette) for _, values, palette in panels]
    draw_legends(sheet, legends, lefts, sheet.top + CAPTION + size[0], panel)
    return sheet.write(path, overwrite=overwrite)


def star_class_colors(classes: StarClasses) -> Tensor:
    """(V, 3) red, green and blue of every vertex, 0 to 1, by what its star is, as in the picture."""
    return torch.tensor(list(_COLORS.values()))[_class_codes(classes)]


def _class_codes(classes: StarClasses) -> Tensor:
    """(V,) number of the class of each vertex in the order of the colours."""
    codes = torch.full_like(classes.kinds, 4, dtype=torch.int64)
    codes[classes.is_kind(StarKind.CONVEX)] = 0
    codes[classes.is_kind(StarKind.SADDLE)] = 2
    codes[classes.good] = 1
    codes[classes.is_kind(StarKind.NEITHER)] = 3
    return codes.cpu()


def _panel(vertices: Tensor, topology: Topology, camera: Camera, size: Size, values: Tensor, colors: Tensor) -> Tensor:
    """The mesh with the cell of each vertex in the colour of its value."""
    vertices, topology = vertices.cpu(), topology.to("cpu")
    corners = values[topology.corners]
    if topology.num_faces > _DETAILED:
        worst = torch.zeros(topology.num_faces, dtype=torch.int64)
        last = len(colors) - 1  # boundary: only where nothing else is known
        rank = torch.where(corners == last, -1, corners)
        worst = (worst - 1).scatter_reduce(0, topology.corner_faces, rank, "amax")
        paint = colors[worst.where(worst >= 0, torch.tensor(last))].to(vertices)
        mesh = MeshView(vertices, topology, camera, size)
        return mesh.paint(shade_faces(vertices, topology, camera, paint))
    points, cells = _cells(vertices, topology)
    mesh = MeshView(points, cells, camera, size)
    ends = cells.edges
    drawn = (ends < topology.num_vertices).any(1)  # halves of edges, not the lines to the middles of faces
    widths = torch.where(drawn, line_width(mesh, 0.1, 0.4, 1.2), 0.0)
    paint = shade_faces(points, cells, camera, colors[corners].to(points))
    return mesh.paint(paint, edges=EdgeStyle(torch.tensor(_INK), widths, opacity=0.5))


def _cells(vertices: Tensor, topology: Topology) -> tuple[Tensor, Topology]:
    """Every face cut into one quad per corner: vertex, middle of the edge ahead, of the face, of the edge behind."""
    middles = vertices[topology.edges].mean(1)
    points = torch.cat([vertices, middles, face_centres(vertices, topology)])
    ahead = topology.num_vertices + topology.corner_edges
    behind = torch.empty_like(ahead)
    behind[topology.next_corners] = ahead
    centre = topology.num_vertices + topology.num_edges + topology.corner_faces
    quads = torch.stack([topology.corners, ahead, centre, behind], dim=1)
    return points, Topology.from_faces(quads, num_vertices=points.shape[0])


def _entries(values: Tensor, palette: dict[str, tuple[float, float, float]]) -> list[Entry]:
    """The classes that there are, with the number of vertices of each."""
    counts = [int((values == number).sum()) for number in range(len(palette))]
    return [Entry(f"{name} {n}", color) for (name, color), n in zip(palette.items(), counts, strict=True) if n]
