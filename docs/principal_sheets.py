"""Draws the pictures of the page on principal-symmetric meshes: ``python docs/principal_sheets.py``.

They are principal_labels.png and principal_strips.png in docs/images; with a folder as argument they go there.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.principal import (
    DevelopableStrips,
    PrincipalEdges,
    developable_strips,
    principal_edges_from_seed,
    principal_edges_of_lattice,
)
from torchfair.shapes import Catenoid, PrincipalParaboloid, principal_triangles
from torchfair.subdivision import loop
from torchfair.viewing import MeshView, fit_camera
from torchfair.viewing.lines import EdgeStyle
from torchfair.viewing.shading import FRONT, shade_faces
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet, points
from torchfair.viewing.wireframe import quiet_edges

IMAGES = Path(__file__).resolve().parent / "images"
CELL, HEIGHT = 400, 300
UP = torch.tensor([0.0, 0.0, 1.0])
PRINCIPAL, EXCEPTION, STRIP = (0.75, 0.22, 0.17), (0.95, 0.66, 0.13), (0.90, 0.72, 0.55)


def cone(sectors: int, rings: int) -> tuple[Tensor, Topology]:
    """A planar lattice of triangles around vertex 0, which has valence ``sectors``."""
    places: list[tuple[float, float]] = [(0.0, 0.0)]
    for ring in range(1, rings + 1):
        for i in range(sectors * ring):
            corner, step = divmod(i, ring)
            a, b = (math.tau * (corner + end) / sectors for end in (0, 1))
            x, y = ((ring - step) * f(a) + step * f(b) for f in (math.cos, math.sin))
            places.append((x, y))

    def number(ring: int, place: int) -> int:
        return 1 + sectors * ring * (ring - 1) // 2 + place % (sectors * ring) if ring else 0

    faces = []
    for ring in range(rings):
        for s in range(sectors):
            inner, outer = s * ring, s * (ring + 1)
            for j in range(ring + 1):
                faces.append([number(ring, inner + j), number(ring + 1, outer + j), number(ring + 1, outer + j + 1)])
                if j < ring:
                    faces.append(
                        [number(ring, inner + j), number(ring + 1, outer + j + 1), number(ring, inner + j + 1)]
                    )
    return torch.tensor(places, dtype=torch.float64), Topology.from_faces(faces)


def lifted(plane: Tensor, bends: int, height: float) -> Tensor:
    """Points over the plane at the height of a saddle with so many valleys, of a bowl if there are none."""
    x, y = plane.unbind(1)
    radius = torch.linalg.vector_norm(plane, dim=1) / plane.abs().amax()
    return torch.stack([x, y, height * radius**2 * torch.cos(bends * torch.atan2(y, x))], dim=1)


def labelled() -> dict[str, tuple[Tensor, PrincipalEdges]]:
    """Meshes with principal edges, and words below them."""
    lattice = principal_triangles(Catenoid(), 10, 18)
    monkey, nine = cone(9, 4)
    bowl, five = cone(5, 7)
    step = loop(nine)
    coarse = principal_edges_from_seed(nine, 0)
    saddle = lifted(monkey, 3, 1.6)
    spoke = five.edges.tolist().index([0, 2])
    return {
        "a lattice": (lattice.vertices, principal_edges_of_lattice(lattice)),
        "one vertex of valence 9": (saddle, coarse),
        "refined": (step.apply(saddle), coarse.refine(step)),
        "valence 5: a seam": (
            lifted(bowl, 0, -1.5),
            principal_edges_from_seed(five, spoke, allow_exceptions=True),
        ),
    }


def draw_labels(path: Path) -> None:
    meshes = labelled()
    sheet = Sheet(2 * MARGIN + len(meshes) * CELL, 2 * MARGIN + HEIGHT + CAPTION)
    for column, (words, (vertices, edges)) in enumerate(meshes.items()):
        topology = edges.topology
        camera, size = fit_camera(
            vertices, towards_eye=torch.tensor([0.1, -0.75, 0.65]), up=UP, width=CELL - 24, height=HEIGHT
        )
        picture = MeshView(vertices, topology, camera, size)
        quiet = quiet_edges(picture)
        colors = torch.where(edges.mask[:, None], torch.tensor(PRINCIPAL), quiet.colors)
        style = EdgeStyle(colors, torch.where(edges.mask, 2.4, quiet.widths), order=edges.mask.int(), opacity=0.85)
        is_exception = torch.zeros(len(vertices), dtype=torch.bool)
        is_exception[edges.exceptions] = True
        beside = is_exception[topology.triangles].any(1)
        base = torch.where(beside[:, None], torch.tensor(EXCEPTION), torch.tensor(FRONT)).double()
        left = MARGIN + column * CELL
        sheet.image(picture.paint(shade_faces(vertices, topology, camera, base), edges=style), left + 12, MARGIN)
        sheet.text(words, left + CELL / 2, MARGIN + HEIGHT + CAPTION / 2, 28, ha="center", va="center")
    sheet.write(path, overwrite=True)


def draw_strips(path: Path) -> None:
    mesh = principal_triangles(PrincipalParaboloid(1.0, -1.0), 12, 10, along="v")
    strips = developable_strips(
        mesh.vertices, principal_edges_of_lattice(mesh).polylines(), mesh.normals, 0.2, sheet_width=7.2
    )
    vertices = torch.cat([mesh.vertices, strips.vertices])
    faces = mesh.topology.face_lists() + [
        [v + len(mesh.vertices) for v in face] for face in strips.topology.face_lists()
    ]
    both = Topology.from_faces(faces)
    width = 2 * CELL
    camera, size = fit_camera(
        vertices, towards_eye=torch.tensor([0.5, -0.8, 0.6]), up=UP, width=width - 24, height=HEIGHT + 140
    )
    picture = MeshView(vertices, both, camera, size)
    base = torch.tensor(FRONT).repeat(both.num_faces, 1).double()
    base[mesh.topology.num_faces :] = torch.tensor(STRIP).double()
    body = HEIGHT + 140
    sheet = Sheet(2 * MARGIN + 2 * width, 2 * MARGIN + body + CAPTION)
    colors = shade_faces(vertices, both, camera, base)
    sheet.image(picture.paint(colors, edges=quiet_edges(picture)), MARGIN + 12, MARGIN)
    _flat(sheet, strips, MARGIN + width + 24, MARGIN, width - 24, body)
    for column, words in enumerate(("strips along principal edges", "the same strips on a sheet")):
        place = MARGIN + (column + 0.5) * width
        sheet.text(words, place, MARGIN + body + CAPTION / 2, 28, ha="center", va="center")
    sheet.write(path, overwrite=True)


def _flat(sheet: Sheet, strips: DevelopableStrips, left: float, top: float, width: float, height: float) -> None:
    axes = sheet.axes(left, top, width, height)
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(0, strips.sheet[0])
    axes.set_ylim(0, strips.sheet[1])
    for name, outline in zip(strips.names, strips.outlines(), strict=True):
        axes.fill(*outline.T.numpy(), facecolor=STRIP, edgecolor="#1b2230", linewidth=points(1.5))
        half = len(outline) // 2
        for ruling in torch.stack([outline[:half], outline[half:].flip(0)], dim=1)[1:-1]:
            axes.plot(*ruling.T.numpy(), color="#1b2230", linewidth=points(0.7))
        middle = (half - 1) // 2
        x, y = outline[[middle, middle + 1, -middle - 1, -middle - 2]].mean(0).tolist()
        axes.text(x, y, name, fontsize=points(14), ha="center", va="center")


def main() -> None:
    """Writes the pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    draw_labels(folder / "principal_labels.png")
    draw_strips(folder / "principal_strips.png")


if __name__ == "__main__":
    main()
