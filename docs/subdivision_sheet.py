"""Draws the picture of the page on subdivision, docs/images/subdivision.png: ``python docs/subdivision_sheet.py``.

With a folder as argument the picture goes there.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.subdivision import refine
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.lines import EdgeStyle
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet
from torchfair.viewing.wireframe import quiet_edges

IMAGES = Path(__file__).resolve().parent / "images"
CELL, HEIGHT = 340, 250
MIDDLE_ROW = 2  # its edges carry the label


def vault() -> tuple[Tensor, Topology, Tensor]:
    """A coarse vault, one half quads and one half triangles, and a mask (E,) of the edges of its middle row."""
    size = 5
    rise = [0.0, 1.5, 0.6, 1.5, 0.0]
    points = [[float(i), float(j), rise[i] + 0.5 * rise[j]] for i in range(size) for j in range(size)]
    faces = []
    for i in range(size - 1):
        for j in range(size - 1):
            a = i * size + j
            quad = [a, a + size, a + size + 1, a + 1]
            faces += [quad] if j < MIDDLE_ROW else [[*quad[:2], quad[3]], quad[1:]]
    topology = Topology.from_faces(faces)
    return torch.tensor(points, dtype=torch.float64), topology, (topology.edges % size == MIDDLE_ROW).all(1)


def main() -> None:
    """Writes the picture."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    vertices, topology, labels = vault()
    corners = torch.zeros(len(vertices), dtype=torch.bool)
    corners[[0, 4, 20, 24]] = True
    steps = {
        "coarse": refine(topology, levels=0),
        "midpoint, 2 levels": refine(topology, "midpoint", 2),
        "hybrid, 2 levels": refine(topology, "hybrid", 2, corners=corners),
        "catmull_clark, 2 levels": refine(topology, "catmull_clark", 2, corners=corners),
    }
    view = view_direction(vertices, topology)
    camera, size = fit_camera(vertices, towards_eye=view.towards_eye, up=view.up, width=CELL - 24, height=HEIGHT)
    sheet = Sheet(2 * MARGIN + len(steps) * CELL, 2 * MARGIN + HEIGHT + CAPTION)
    for column, (words, step) in enumerate(steps.items()):
        fine = step.apply(vertices)
        picture = MeshView(fine, step.topology, camera, size)
        quiet = quiet_edges(picture)
        labelled = step.carry_edge_labels(labels)
        colors = torch.where(labelled[:, None], torch.tensor([0.75, 0.22, 0.17]), quiet.colors)
        edges = EdgeStyle(colors, torch.where(labelled, 2.5, quiet.widths), order=labelled.int(), opacity=0.8)
        left = MARGIN + column * CELL
        sheet.image(picture.paint(shade_faces(fine, step.topology, camera), edges=edges), left + 12, MARGIN)
        sheet.text(words, left + CELL / 2, MARGIN + HEIGHT + CAPTION / 2, 21, ha="center", va="center")
    sheet.write(folder / "subdivision.png", overwrite=True)


if __name__ == "__main__":
    main()
