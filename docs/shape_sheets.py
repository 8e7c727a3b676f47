"""Draws the pictures of the page on shapes: ``python docs/shape_sheets.py`` writes them to docs/images.

``shapes.png`` shows the analytic surfaces, ``meshes.png`` the kinds of meshes on one of them, and ``refinement.svg``
how E of these kinds behaves under refinement. With a folder as argument all go there, the chart as PNG.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path

from drawing_tools import BLUE, FAINT, GREEN, INK, RED, save
from matplotlib.figure import Figure

from torchfair.energies import normal_variation
from torchfair.shapes import (
    SURFACES,
    Enneper,
    ShapeMesh,
    Sphere,
    Surface,
    irregular_triangles,
    parameter_quads,
    principal_quads,
    principal_triangles,
    rotated_lattice,
)
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet
from torchfair.viewing.wireframe import quiet_edges

IMAGES = Path(__file__).resolve().parent / "images"
CELL, PICTURE_HEIGHT = 300, 220

KINDS: dict[str, Callable[[Surface, int], ShapeMesh]] = {
    "principal quads": lambda surface, n: principal_quads(surface, n, 2 * n),
    "principal triangles": lambda surface, n: principal_triangles(surface, n, 2 * n),
    "lattice at 15 degrees": lambda surface, n: rotated_lattice(surface, n, 2 * n, math.pi / 12),
    "irregular triangles": lambda surface, n: irregular_triangles(surface, 2 * n * n),
    "cut squares at 45 degrees": lambda surface, n: rotated_lattice(surface, n, 2 * n, math.pi / 4, kind="split"),
}
COLORS = dict(zip(KINDS, (GREEN, BLUE, "#8e5ea2", "#b07d12", RED), strict=True))


def energy_ratio(mesh: ShapeMesh) -> float:
    """E of a mesh over C of its surface."""
    return float(normal_variation(mesh.vertices, mesh.topology)) / mesh.surface.total_absolute_curvature()


def write_sheet(path: Path, meshes: dict[str, ShapeMesh], columns: int) -> None:
    """A table of pictures with a caption below each."""
    rows = math.ceil(len(meshes) / columns)
    sheet = Sheet(2 * MARGIN + columns * CELL, 2 * MARGIN + rows * (PICTURE_HEIGHT + CAPTION))
    for number, (words, mesh) in enumerate(meshes.items()):
        left, top = MARGIN + number % columns * CELL, MARGIN + number // columns * (PICTURE_HEIGHT + CAPTION)
        view = view_direction(mesh.vertices, mesh.topology)
        camera, size = fit_camera(
            mesh.vertices, towards_eye=view.towards_eye, up=view.up, width=CELL - 24, height=PICTURE_HEIGHT
        )
        picture = MeshView(mesh.vertices, mesh.topology, camera, size)
        colors = shade_faces(mesh.vertices, mesh.topology, camera)
        sheet.image(picture.paint(colors, edges=quiet_edges(picture)), left + 12, top)
        sheet.text(words, left + CELL / 2, top + PICTURE_HEIGHT + CAPTION / 2, 19, ha="center", va="center")
    sheet.write(path, overwrite=True)


def surfaces() -> dict[str, ShapeMesh]:
    """Every surface of the catalogue along its parameter lines."""
    meshes = {}
    for name, make in SURFACES.items():
        surface = make()
        sizes = (16, 24) if any(surface.periodic) else (16, 16)
        meshes[name] = parameter_quads(surface, *sizes)
    return meshes


def kinds(n: int = 12) -> dict[str, ShapeMesh]:
    """Every kind of mesh on Enneper's surface, with its energy."""
    meshes = {name: make(Enneper(), n) for name, make in KINDS.items()}
    return {f"{name}\nE = {energy_ratio(mesh):.2f} C": mesh for name, mesh in meshes.items()}


def refinement() -> Figure:
    """E / C over the number of faces."""
    figure = Figure(figsize=(8.2, 3.2), facecolor="white", layout="constrained")
    for axes, surface in zip(figure.subplots(1, 2, sharey=True), (Enneper(), Sphere(latitudes=(-1, 1))), strict=True):
        axes.axhline(1, color=FAINT, linewidth=0.8)
        for name, make in KINDS.items():
            meshes = [make(surface, n) for n in (6, 9, 13, 18, 26)]
            faces = [mesh.topology.num_faces for mesh in meshes]
            axes.plot(
                faces, [energy_ratio(mesh) for mesh in meshes], "o-", color=COLORS[name], label=name, ms=3, lw=1.3
            )
        axes.set_xscale("log")
        axes.set_title(
            "Enneper's surface, K < 0" if isinstance(surface, Enneper) else "zone of a sphere, K > 0", fontsize=9
        )
        axes.set_xlabel("faces", fontsize=8)
        axes.tick_params(labelsize=8, colors=INK)
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("E / C", fontsize=8)
    figure.axes[1].legend(fontsize=7.5, frameon=False)
    return figure


def main() -> None:
    """Writes all pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    write_sheet(folder / "shapes.png", surfaces(), 5)
    write_sheet(folder / "meshes.png", kinds(), 5)
    save(refinement(), folder / ("refinement.png" if len(sys.argv) > 1 else "refinement.svg"))


if __name__ == "__main__":
    main()
