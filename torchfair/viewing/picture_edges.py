"""Where the energy sits: edges coloured by l |a|."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ..energies import angle_variation_per_edge
from ..errors import ShapeError
from ..topology import Topology
from .camera import Camera, fit_camera
from .captions import energy_caption
from .lines import EdgeStyle
from .render import MeshView, one_mesh
from .shading import shade_faces
from .sheet import CAPTION, GAP, MARGIN, Sheet, points
from .view_direction import ViewDirection, view_direction
from .wireframe import line_width

if TYPE_CHECKING:
    from matplotlib.colors import ListedColormap

_BAR = 150  # room for the colour bar
_COLOR_MAP = "magma_r"
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
    topologies = [topology] * len(meshes) if isinstance(topology, Topology) else list(topology)
    if not meshes or len(topologies) != len(meshes):
        raise ShapeError("meshes", "at least one, and one topology for each", f"{len(meshes)} and {len(topologies)}")
    vertices = [one_mesh(v, t) for v, t in zip(meshes.values(), topologies, strict=True)]
    values = [angle_variation_per_edge(v, t) for v, t in zip(vertices, topologies, strict=True)]
    limit, clipped = _scale_end(torch.cat(values))
    columns = min(columns, len(meshes))
    panel = (width - 2 * MARGIN - _BAR - (columns - 1) * GAP) // columns
    towards_eye, up = view or view_direction(vertices[0], topologies[0])
    camera = fit_camera(*vertices, towards_eye=towards_eye, up=up, width=panel)

    row = CAPTION + camera.height
    rows = -(-len(meshes) // columns)
    sheet = Sheet(width, rows * row + MARGIN, title)
    for number, (name, mesh) in enumerate(zip(meshes, vertices, strict=True)):
        left = MARGIN + (number % columns) * (panel + GAP)
        top = sheet.top + (number // columns) * row
        sheet.caption(energy_caption(name, mesh, topologies[number]), left, top, panel)
        sheet.image(_panel(mesh, topologies[number], camera, values[number] / limit), left, top + CAPTION)
    _color_bar(sheet, limit, clipped, rows * row)
    return sheet.write(path, overwrite=overwrite)


def _panel(vertices: Tensor, topology: Topology, camera: Camera, values: Tensor) -> Tensor:
    """One mesh, its interior edges coloured by ``values`` (1 is the end of the scale), the worst on top."""
    mesh = MeshView(vertices, topology, camera)
    interior, boundary = topology.num_interior_edges, topology.num_edges - topology.num_interior_edges
    colors = torch.cat([map_colors(values), torch.full((boundary, 3), 0.6)])
    widths = torch.full((topology.num_edges,), line_width(mesh, 0.16, 1.0, 3.2))
    widths[interior:] = 1.0
    order = torch.cat([values.cpu(), torch.full((boundary,), -1.0, dtype=values.dtype)])
    pale = 0.75 + 0.25 * shade_faces(vertices, topology, camera, vertices.new_ones(3))
    return mesh.paint(pale, edges=EdgeStyle(colors, widths, order))


def map_colors(values: Tensor) -> Tensor:
    """Colours ``(N, 3)`` (float32, on the CPU) of values in 0..1: light to dark; values beyond 1 as 1."""
    table = torch.from_numpy(_color_map()(torch.linspace(0, 1, 256).numpy())[:, :3]).to(torch.float32)
    return table[(values.detach().cpu() * 255).round().clamp(0, 255).to(torch.int64)]


def _color_map() -> ListedColormap:
    import matplotlib
    from matplotlib.colors import ListedColormap

    base = matplotlib.colormaps[_COLOR_MAP]
    return ListedColormap(base(torch.linspace(_LIGHTEST, 1, 256).numpy()))


def _scale_end(values: Tensor) -> tuple[float, bool]:
    """End of the colour scale, and whether some values lie beyond it."""
    if values.shape[0] == 0:
        return 1.0, False
    values = values.to("cpu", torch.float64)
    largest = float(values.max())
    usual = float(values[:: max(1, values.shape[0] // 1_000_000)].quantile(0.98))
    clipped = largest > 1.5 * usual > 0
    return (usual if clipped else largest) or 1.0, clipped


def _color_bar(sheet: Sheet, limit: float, clipped: bool, body: int) -> None:
    """The colour scale at the right, halfway down the body."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    height = min(0.75 * (body - CAPTION), 520)
    top = sheet.top + CAPTION + (body - CAPTION - height) / 2
    axes = sheet.axes(sheet.width - MARGIN - _BAR + 44, top, 26, height)
    scale = ScalarMappable(Normalize(0, limit), _color_map())
    bar = sheet.figure.colorbar(scale, cax=axes, extend="max" if clipped else "neither", extendfrac=0.04)
    bar.outline.set_linewidth(points(1))
    bar.ax.tick_params(labelsize=points(19), width=points(1), length=points(5))
    bar.ax.set_title(r"$\ell\,|\alpha|$", fontsize=points(26), pad=points(16))
