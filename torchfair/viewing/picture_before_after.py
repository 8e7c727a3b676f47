"""A mesh before and after, in daylight and as a mirror."""

from __future__ import annotations

import os
from collections.abc import Sequence

from torch import Tensor

from .._one_mesh import one_mesh
from ..reflection import Stripes, face_mirror_directions
from ..topology import Topology
from .camera import fit_camera
from .captions import energy_caption
from .close_up import Part, Place, part_around, worst_place
from .common_topology import topologies_of
from .render import MeshView
from .shading import shade_faces, stripe_colors, stripe_frequency
from .sheet import CAPTION, GAP, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import outline, quiet_edges

_CLOSE = 0.6  # rows of a close-up, over its columns


def picture_before_after(
    path: str | os.PathLike[str],
    before: Tensor,
    after: Tensor,
    topology: Topology | Sequence[Topology],
    title: str = "",
    *,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG with the mesh before (left) and after (right): flat shaded above, mirroring stripes below.

    Of larger meshes a third row shows what surrounds the edge that had the largest ``l |a|`` before, in both.

    All four views share one camera, and both reflections the same striped surroundings: a smooth surface shows
    smooth stripes. The captions give E (normal variation) and E' (angle variation).

    Args:
        path: the PNG file.
        before: positions ``(V, 3)``.
        after: positions ``(V, 3)``.
        topology: connectivity of both, or one for each.
        title: words on top; none by default.
        view: where to look from; by default :func:`view_direction` of the mesh before.
        width: columns of pixels of the file; the number of rows follows from the shape of the mesh.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology.
        MeshFileError: if the file cannot be written.
    """
    topologies = topologies_of(2, topology)
    before, after = (one_mesh(v, t) for v, t in zip((before, after), topologies, strict=True))
    towards_eye, up = view or view_direction(before, topologies[0])
    panel = (width - 2 * MARGIN - GAP) // 2
    camera, size = fit_camera(before, after, towards_eye=towards_eye, up=up, width=panel)
    across = camera.axes[0, 0]
    meshes = list(zip((before, after), topologies, strict=True))
    mirrored = [face_mirror_directions(vertices, topology, camera)[0] for vertices, topology in meshes]
    stripes = Stripes(across, stripe_frequency(mirrored[0] @ across.to(before), topologies[0]))

    row = CAPTION + size[0]
    place = worst_place(*meshes[0])
    parts = _parts(meshes, place)
    close = round(panel * _CLOSE) if parts else 0
    sheet = Sheet(width, 2 * row + (CAPTION + close if parts else 0) + MARGIN, title)
    sheet.note("daylight", MARGIN, sheet.top)
    sheet.note("mirror", MARGIN, sheet.top + row)
    captions = energy_caption("before", *meshes[0]), energy_caption("after", *meshes[1], meshes[0])
    for column, ((vertices, topology), caption) in enumerate(zip(meshes, captions, strict=True)):
        left = MARGIN + column * (panel + GAP)
        mesh = MeshView(vertices, topology, camera, size)
        sheet.caption(caption, left, sheet.top, panel)
        daylight = mesh.paint(shade_faces(vertices, topology, camera), edges=quiet_edges(mesh))
        sheet.image(daylight, left, sheet.top + CAPTION)
        colors = stripe_colors(stripes(mirrored[column])[:, 0])
        sheet.image(mesh.paint(colors, edges=outline(mesh)), left, sheet.top + row + CAPTION)
    if place is not None and parts:
        sheet.note("close-up of the worst place before", MARGIN, sheet.top + 2 * row)
        views = _close_views(parts, place, towards_eye, (close, panel))
        for column, view_of_part in enumerate(views):
            sheet.image(view_of_part, MARGIN + column * (panel + GAP), sheet.top + 2 * row + CAPTION)
    return sheet.write(path, overwrite=overwrite)


def _parts(meshes: Sequence[tuple[Tensor, Topology]], place: Place | None) -> list[Part]:
    """What surrounds a place, in all meshes; nothing where it is as large as a mesh."""
    if place is None:
        return []
    found = [part_around(vertices, topology, place) for vertices, topology in meshes]
    return [] if None in found else [part for part in found if part is not None]


def _close_views(parts: Sequence[Part], place: Place, up: Tensor, size: tuple[int, int]) -> list[Tensor]:
    """Parts as mirrors, seen along the normal of the place, from one eye and among the same stripes."""
    used = [part.vertices[part.topology.corners] for part in parts]
    camera, size = fit_camera(*used, towards_eye=place.normal.cpu(), up=up, width=size[1], height=size[0])
    across = camera.axes[0, 0]
    rays = [face_mirror_directions(part.vertices, part.topology, camera)[0] for part in parts]
    stripes = Stripes(across, stripe_frequency(rays[0] @ across.to(rays[0]), parts[0].topology))
    pictures = []
    for part, mirrored in zip(parts, rays, strict=True):
        mesh = MeshView(part.vertices, part.topology, camera, size)
        pictures.append(mesh.paint(stripe_colors(stripes(mirrored)[:, 0]), edges=quiet_edges(mesh)))
    return pictures
