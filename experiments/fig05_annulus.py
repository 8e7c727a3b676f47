"""Paper Fig. 5: design with principal-symmetric triangle meshes.

The mesh has the size of the paper's (table 20): an annulus of valence 6 with 714 vertices, 2058 edges and 1344
triangles. It starts as a catenoid with the principal edges along its parallels. The designer pulls the upper rim out of
round at four handles and holds the lower one at others; the mesh stays principal-symmetric: at every inner vertex
the neighbours across non-principal edges lie on a sphere, along principal edges the normals of these spheres are
coplanar. So all stars are good saddles, normal pyramids do not intersect themselves, and developable strips stand on
the mesh along principal edges.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _designs import (
    Handles,
    Level,
    design_levels,
    extent,
    largest_pull,
    level_strips,
    moved,
    pulls_page,
    strips_page,
    vertex_at,
)
from torch import Tensor

from torchfair.formfinding import SymmetricDesign, SymmetricSettings
from torchfair.geometry import gauss_image
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import Catenoid, ShapeMesh, principal_triangles
from torchfair.stars import normal_pyramid, pyramid_self_intersections
from torchfair.viewing import ViewDirection
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet, points
from torchfair.viewing.sphere import draw_arcs, draw_points, draw_sphere, fit_sphere_view

NAME = "fig05_annulus"
DESIGN, GAUSS, STRIPS = "design.png", "gauss_image.png", "strips.png"
FILES = (DESIGN, GAUSS, STRIPS, "start.obj", "design.obj", "strips.obj", "strips.svg")
SURFACE = Catenoid(1.0, (-1.2, 1.2))
LOW, HIGH = SURFACE.heights
VIEW = ViewDirection(torch.tensor([0.75, -0.85, 0.75]), torch.tensor([0.0, 0.0, 1.0]))
PYRAMIDS = ((0.0, 0.1), (math.pi / 2, 0.1), (math.pi / 4, 0.6), (math.pi, 0.9))
"""Angles and heights on the start of the vertices whose normal pyramids are drawn."""


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    around: int = setting(42, "cells around the annulus", least=8)
    rings: int = setting(16, "rows of triangles between the rims", least=4)
    outwards: float = setting(0.15, "pull away from the axis at two opposite handles, in sizes of the mesh")
    inwards: float = setting(0.10, "pull towards the axis at the two handles between them, in sizes of the mesh")
    upwards: float = setting(0.05, "pull up at the first two and down at the others, in sizes of the mesh")
    held: int = setting(6, "handles that hold the lower rim", least=0)
    strip_height: float = setting(1.0, "height of strips in mean edges", least=0.05)
    formulation: str = setting("spheres", "unknowns", choices=("spheres", "eliminated", "lifted"))
    width: int = setting(2000, "columns of pixels of rendered pictures", least=300)


def annulus(config: Config) -> tuple[ShapeMesh, PrincipalEdges]:
    """The start and its principal edges."""
    mesh = principal_triangles(SURFACE, config.rings, config.around, along="u")
    return mesh, principal_edges_of_lattice(mesh, "u")


def rim_handles(mesh: ShapeMesh, config: Config) -> Handles:
    """Where four vertices of the upper rim go, and which of the lower rim stay."""
    size = extent(mesh.vertices)
    handles = {}
    for number in range(4):
        vertex = vertex_at(mesh, number * math.pi / 2, HIGH)
        out, up = (-config.inwards, -config.upwards) if number % 2 else (config.outwards, config.upwards)
        handles[vertex] = moved(mesh.vertices, vertex, out * size, up * size)
    for number in range(config.held):
        vertex = vertex_at(mesh, number * 2 * math.pi / config.held, LOW)
        handles[vertex] = mesh.vertices[vertex].tolist()
    return handles


# ---- pictures ------------------------------------------------------------------------------------------


def draw_gauss_image(design: Level, chosen: list[int], config: Config, results: Results) -> Report:
    """The whole Gauss image, arcs of self-intersecting pyramids red, and some normal pyramids beside it."""
    vertices, topology = design.vertices, design.topology
    crossing = pyramid_self_intersections(vertices, topology) > 0
    image = gauss_image(vertices, topology)
    small = (config.width - 2 * MARGIN - 2 * GAP) // 4
    large = config.width - 2 * MARGIN - 2 * GAP - 2 * small
    sheet = Sheet(config.width, 2 * CAPTION + large + MARGIN)
    sheet.caption(
        f"Gauss image, {int(crossing.sum())} of {len(design.principal.stars().vertices)} pyramids cross",
        MARGIN,
        0,
        large,
    )
    view = fit_sphere_view(image.points, towards_eye=VIEW.towards_eye, up=VIEW.up)
    axes = sheet.axes(MARGIN, CAPTION, large, large)
    draw_sphere(axes, view)
    draw_arcs(axes, view, image.points, image.arcs, points(1.3), 0.8)
    draw_points(axes, view, image.points, points(3.5))
    for number, vertex in enumerate(chosen):
        left = MARGIN + large + GAP + (number % 2) * (small + GAP)
        top = (number // 2) * (small + CAPTION + GAP)
        sheet.caption(f"pyramid of vertex {vertex}", left, top, small)
        _draw_pyramid(sheet, normal_pyramid(vertices, topology, vertex), left, top + CAPTION, small)
    sheet.write(results.path(GAUSS), overwrite=results.force)
    return {"crossing": int(crossing.sum()), "pyramids_drawn": chosen}


def _draw_pyramid(sheet: Sheet, normals: Tensor, left: int, top: int, size: int) -> None:
    """A window on the sphere around one pyramid."""
    view = fit_sphere_view(normals, towards_eye=normals.sum(0), up=VIEW.up)
    axes = sheet.axes(left, top, size, size)
    draw_sphere(axes, view)
    corner = torch.arange(len(normals))
    draw_arcs(axes, view, normals, torch.stack([corner, corner.roll(-1)], dim=1), points(2.6))
    draw_points(axes, view, normals, points(8))


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Pulls, measures, draws."""
    mesh, principal = annulus(config)
    handles = rim_handles(mesh, config)
    settings = SymmetricSettings(formulation=config.formulation)  # type: ignore[arg-type]  # checked there
    maker = SymmetricDesign(mesh.vertices, principal, handles=list(handles), settings=settings)
    (design,) = design_levels(maker, handles, 0)
    start = Level(mesh.vertices, principal, {})
    results.mesh("start.obj", mesh.vertices, mesh.topology)
    results.mesh("design.obj", design.vertices, design.topology)
    strips, strip_report = level_strips(design, config.strip_height, ("strips.obj", "strips.svg"), results)
    pulls_page(start, design, handles, VIEW, config.width).write(results.path(DESIGN), overwrite=results.force)
    gauss = draw_gauss_image(design, [vertex_at(mesh, *place) for place in PYRAMIDS], config, results)
    strips_page(design, strips, VIEW, config.width).write(results.path(STRIPS), overwrite=results.force)
    pull = {"handles": handles, "largest_pull": largest_pull(mesh.vertices, handles)}
    return {"design": design.report, "strips": strip_report, "gauss_image": gauss, **pull}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, FILES, arguments)


if __name__ == "__main__":
    sys.exit(main())
