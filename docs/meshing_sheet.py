"""Draws the pictures of the page on meshing, docs/images/meshing_*.png: ``python docs/meshing_sheet.py``.

With a folder as argument the pictures go there.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.meshing import MeshingSettings, principal_quads, principal_triangles
from torchfair.shapes import FreeFormPatch, Hyperboloid, irregular_triangles
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.lines import EdgeStyle
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet
from torchfair.viewing.wireframe import quiet_edges

IMAGES = Path(__file__).resolve().parent / "images"
CELL, HEIGHT = 520, 420

Panel = tuple[Tensor, Topology, Tensor | None]
"""Vertices, topology and marked edges."""


def main() -> None:
    """Writes the pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    draw(folder / "meshing_stages.png", stages())
    draw(folder / "meshing_adaptive.png", spacings())
    draw_creases(folder / "meshing_creases.png")


def stages() -> dict[str, Panel]:
    """A surface, its quads and its triangles."""
    surface = irregular_triangles(FreeFormPatch(), 2500)
    vertices, topology = surface.vertices, surface.topology
    quads = principal_quads(vertices, topology, count=400)
    lattice = principal_triangles(vertices, topology, count=800)
    return {
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


def spacings() -> dict[str, Panel]:
    """A surface that flares, with quads of one length and of lengths that follow curvature."""
    surface = irregular_triangles(Hyperboloid(0.5, 1.2, heights=(-0.6, 2.0)), 2500)
    panels: dict[str, Panel] = {}
    for words, settings in (("uniform", MeshingSettings()), ("adaptive", MeshingSettings(adaptive=True))):
        quads = principal_quads(surface.vertices, surface.topology, count=500, settings=settings)
        off = quads.report["distance_max"] * quads.report["mean_edge"]
        panels[f"{words}: {quads.report['faces']} quads, at most {off:.4f} off"] = quads.vertices, quads.topology, None
    return panels


def draw(path: Path, panels: dict[str, Panel]) -> None:
    """Writes meshes side by side, seen as the first one is seen best."""
    vertices, topology, _ = next(iter(panels.values()))
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
    sheet.write(path, overwrite=True)


def draw_creases(path: Path) -> None:
    """Creases that are lines of the mesh, and others that cut cells."""
    x, y = torch.meshgrid(torch.linspace(-1, 1, 61), torch.linspace(-1, 1, 61), indexing="ij")
    turn = (math.pi * (x + 0.5)).clamp(0, math.pi)  # half a circle of the radius 1/2 along x, level beside it
    across = torch.where(x.abs() <= 0.5, -0.5 * turn.cos(), x)
    heights = {
        "creases as lines": (across, 0.5 * turn.sin()),
        "and as cuts": (x, 0.7 - 0.7 * torch.maximum(x.abs(), y.abs())),
    }
    sheet = Sheet(2 * MARGIN + 2 * CELL, 2 * MARGIN + HEIGHT + CAPTION)
    for column, (words, (along, height)) in enumerate(heights.items()):
        points = torch.stack([along, y, height], -1).reshape(-1, 3).double()
        corner = torch.arange(61 * 61).reshape(61, 61)
        quads = torch.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], -1).reshape(-1, 4)
        falls = points[quads].mean(1)[:, :2].prod(1) < 0  # cut along the diagonals of the square
        quads = torch.where(falls[:, None], quads.roll(1, 1), quads)
        triangles = torch.cat([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        found = principal_quads(points, Topology.from_faces(triangles, len(points)), count=240)
        view = view_direction(found.vertices, found.topology)
        camera, size = fit_camera(
            found.vertices, towards_eye=view.towards_eye, up=view.up, width=CELL - 24, height=HEIGHT
        )
        picture = MeshView(found.vertices, found.topology, camera, size)
        shaded = shade_faces(found.vertices, found.topology, camera)
        left = MARGIN + column * CELL
        sheet.image(picture.paint(shaded, edges=quiet_edges(picture, found.creases.edges)), left + 12, MARGIN)
        sheet.text(words, left + CELL / 2, MARGIN + HEIGHT + CAPTION / 2, 21, ha="center", va="center")
    sheet.write(path, overwrite=True)


if __name__ == "__main__":
    main()
