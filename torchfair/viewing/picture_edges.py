"""Where the energy sits: edges coloured by l |a|."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from .._remembered import remembering
from ..energies import angle_variation_per_edge
from ..errors import ShapeError
from ..geometry import edge_lengths
from ..topology import Topology
from .camera import fit_camera
from .captions import energy_caption
from .color_scale import BAR, ColorScale
from .common_topology import topologies_of
from .lines import EdgeStyle
from .render import MeshView
from .shading import shade_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet
from .view_direction import ViewDirection, view_direction
from .wireframe import line_width

_ALIKE = 1.25  # quotient of mean edges up to which meshes are equally fine
_LIGHTEST = 0.04  # start of the colour map: what is lighter cannot be told from the faces


def picture_edges(
    path: str | os.PathLike[str],
    meshes: Mapping[str, Tensor],
    topology: Topology | Sequence[Topology],
    title: str = "",
    *,
    columns: int = 2,
    view: ViewDirection | None = None,
    width: int = 1600,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG of meshes side by side, each interior edge coloured by ``l_e |a_e|`` (paper Fig. 7).

    Camera and colour scale are common to all; the scale ends at the largest value, or at the 98 % quantile where
    the largest is more than 1.5 times that (the colour bar then ends in an arrow). Boundary edges are thin and grey.
    Of meshes with very different mean edges, values are divided by the square of these: ``l |a|`` of one surface is
    four times as large on edges twice as long.

    Args:
        path: the PNG file.
        meshes: captions and positions ``(V, 3)``.
        topology: connectivity of all, or one per mesh.
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
    topologies = topologies_of(len(meshes), topology)
    vertices = [one_mesh(v, t) for v, t in zip(meshes.values(), topologies, strict=True)]
    with remembering():
        terms = [angle_variation_per_edge(v, t) for v, t in zip(vertices, topologies, strict=True)]
        label, values = _comparable(terms, vertices, topologies)
        scale = ColorScale.of(torch.cat(values), label, color_map="magma_r", lightest=_LIGHTEST)
        columns = min(columns, len(meshes))
        panel = (width - 2 * MARGIN - BAR - (columns - 1) * GAP) // columns
        towards_eye, up = view or view_direction(vertices[0], topologies[0])
        camera, size = fit_camera(*vertices, towards_eye=towards_eye, up=up, width=panel)

        row = CAPTION + size[0]
        rows = -(-len(meshes) // columns)
        sheet = Sheet(width, rows * row + MARGIN, title)
        for number, (name, mesh) in enumerate(zip(meshes, vertices, strict=True)):
            left = MARGIN + (number % columns) * (panel + GAP)
            top = sheet.top + (number // columns) * row
            sheet.caption(energy_caption(name, mesh, topologies[number], terms=terms[number]), left, top, panel)
            shown = MeshView(mesh, topologies[number], camera, size)
            sheet.image(_panel(shown, values[number], scale), left, top + CAPTION)
        scale.draw_bar(sheet, rows * row)
    return sheet.write(path, overwrite=overwrite)


def _comparable(
    values: Sequence[Tensor], vertices: Sequence[Tensor], topologies: Sequence[Topology]
) -> tuple[str, list[Tensor]]:
    """Label and values of the scale: l |a|, over the squared mean edge where meshes are not equally fine."""
    means = [
        float(edge_lengths(v, t).mean()) if t.num_edges else 0.0 for v, t in zip(vertices, topologies, strict=True)
    ]
    if not min(means) > 0.0 or max(means) <= _ALIKE * min(means):
        return r"$\ell\,|\alpha|$", list(values)
    return r"$\ell\,|\alpha| / \bar\ell^2$", [value / mean**2 for value, mean in zip(values, means, strict=True)]


def _panel(mesh: MeshView, values: Tensor, scale: ColorScale) -> Tensor:
    """One mesh, its interior edges coloured by ``values``, the worst on top."""
    topology = mesh.topology
    interior, boundary = topology.num_interior_edges, topology.num_edges - topology.num_interior_edges
    colors = torch.cat([scale.colors(values), torch.full((boundary, 3), 0.6)])
    widths = torch.full((topology.num_edges,), line_width(mesh, 0.16, 1.0, 3.2))
    widths[interior:] = 1.0
    order = torch.cat([values.cpu(), torch.full((boundary,), -1.0, dtype=values.dtype)])
    pale = 0.75 + 0.25 * shade_faces(mesh.vertices, topology, mesh.camera, mesh.vertices.new_ones(3))
    return mesh.paint(pale, edges=EdgeStyle(colors, widths, order))
