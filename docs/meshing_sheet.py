"""Draws the picture of the page on meshing, docs/images/meshing_stages.png: ``python docs/meshing_sheet.py``.

With a folder as argument the picture goes there.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.meshing import principal_quads, principal_triangles
from torchfair.shapes import FreeFormPatch, irregular_triangles
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.lines import EdgeStyle
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet
from torchfair.viewing.wireframe import quiet_edges

IMAGES = Path(__file__).resolve().parent / "images"
CELL, HEIGHT = 520, 420


def main() -> None:
    """Writes the picture."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    surface = irregular_triangles(FreeFormPatch(), 2500)
    vertices, topology = surface.vertices, surface.topology
    quads = principal_quads(vertices, topology, count=400)
    lattice = principal_triangles(vertices, topology, count=800)
    panels: dict[str, tuple[Tensor, Topology, Tensor | None]] = {
        "design surface": (vertices, topology, None),
        f"principal quads, E/C = {quads.report['variation_over_curvature']:.2f}": (
            quads.vertices,
            quads.topology,
            None,
        ),
        f"triangles, E/C = {lattice.report['variation_over_curvature']:.2f}": (
            lattice.vertices,
            lattice.topology,
            lattice.principal.mask,
        ),
    }
    view = view_direction(vertices, topology)
    camera, size = fit_camera(vertices, towards_eye=view.towards_eye, up=view.up, width=CELL - 24, height=HEIGHT)
    sheet = Sheet(2 * MARGIN + len(panels) * CELL, 2 * MARGIN + HEIGHT + CAPTION)
    for column, (words, (points, connectivity, marked)) in enumerate(panels.items()):
        picture = MeshView(points, connectivity, camera, size)
        edges = quiet_edges(picture)
        if marked is not None:
            colors = torch.where(marked[:, None], torch.tensor([0.75, 0.22, 0.17]), edges.colors)
            edges = EdgeStyle(colors, torch.where(marked, 2.0, edges.widths), order=marked.int(), opacity=0.8)
        left = MARGIN + column * CELL
        painted = picture.paint(shade_faces(points, connectivity, camera), edges=edges)
        sheet.image(painted, left + 12, MARGIN)
        sheet.text(words, left + CELL / 2, MARGIN + HEIGHT + CAPTION / 2, 21, ha="center", va="center")
    sheet.write(folder / "meshing_stages.png", overwrite=True)


if __name__ == "__main__":
    main()
