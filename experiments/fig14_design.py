"""Paper Fig. 14 (a) to (g): a principal-symmetric design from a torus, refined twice, and its reflections.

The start has the size of the paper's (table 20): a torus of 480 vertices, 1440 edges and 960 triangles, principal edges
along the circles around the axis, the direction of smaller curvature. The designer pulls handles on the outer equator;
developable strips stand on the coarse design. It is refined by Loop subdivision and solved again, to 1920 and 7680
vertices. All levels mirror the same stripes as a smooth reference surface, which is the finest level subdivided once
more and shaded with vertex normals, and as a principal quad mesh: every vertex of the finest triangle mesh has
neighbours along both principal directions, those along principal edges and those across two rows of triangles.
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
from _reflected_designs import (
    SMOOTH,
    draw_reflections,
    is_inside,
    reflection_scores,
    smooth_surface,
    whole_and_near,
)
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import SymmetricDesign, SymmetricSettings
from torchfair.geometry import planarity
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import ShapeMesh, Torus, principal_triangles
from torchfair.viewing import ViewDirection

NAME = "fig14_design"
DESIGN, REFLECTIONS, STRIPS = "design.png", "reflections.png", "strips.png"
QUADS = "principal quads"
SURFACE = Torus(2.0, 0.8)
VIEW = ViewDirection(torch.tensor([0.25, -0.8, 0.95]), torch.tensor([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    around: int = setting(30, "cells around the axis", least=6)
    rows: int = setting(16, "rows of triangles around the tube; even", least=6)
    outwards: float = setting(0.15, "pull away from the axis at two opposite handles, in sizes of the mesh")
    inwards: float = setting(0.10, "pull towards the axis at the two handles between them, in sizes of the mesh")
    levels: int = setting(2, "how often the design is refined", least=0)
    smooth: int = setting(1, "how often the finest level is refined for the smooth reference", least=0)
    strip_height: float = setting(0.6, "height of strips in mean edges", least=0.05)
    frequency: float = setting(1.2, "stripe pairs per unit of the mirrored direction", least=0.1)
    size: int = setting(256, "rows and columns of the pictures that are scored", least=32)
    joints: float = setting(0.35, "opacity of the joints between panels", least=0.0)
    formulation: str = setting("spheres", "unknowns", choices=("spheres", "eliminated", "lifted"))
    width: int = setting(2600, "columns of pixels of rendered pictures", least=300)


def files(config: Config) -> list[str]:
    """Names of all files for some settings."""
    levels = [f"level_{level}.obj" for level in range(config.levels + 1)]
    return [DESIGN, REFLECTIONS, STRIPS, "start.obj", *levels, "principal_quads.obj", "strips.obj", "strips.svg"]


def equator_handles(mesh: ShapeMesh, config: Config) -> Handles:
    """Four vertices of the outer equator, pulled away from the axis and towards it in turn."""
    pulls = [size * extent(mesh.vertices) for size in (config.outwards, -config.inwards)]
    chosen = [vertex_at(mesh, number * math.pi / 2, 0.0) for number in range(4)]
    return {vertex: moved(mesh.vertices, vertex, pulls[number % 2]) for number, vertex in enumerate(chosen)}


# ---- principal quads -----------------------------------------------------------------------------------


def principal_quad_mesh(level: Level, step: int) -> tuple[Tensor, Topology]:
    """Every ``step``-th column of every other row of a closed lattice, joined along both principal directions."""
    lines = torch.stack(every_other_line(level.principal))[:, ::step]
    numbers = torch.arange(lines.numel()).view(lines.shape)
    corners = [numbers, numbers.roll(-1, 1), numbers.roll((-1, -1), (0, 1)), numbers.roll(-1, 0)]
    faces = torch.stack(corners, dim=-1).reshape(-1, 4)
    return level.vertices[lines.reshape(-1)], Topology.from_faces(faces)


def every_other_line(principal: PrincipalEdges) -> list[Tensor]:
    """Closed principal polylines without their last vertex, each two rows of triangles after the one before.

    Vertices of the same number lie on lines across; triangles are on the left of the polylines.
    """
    opposite: dict[tuple[int, int], int] = {}
    for a, b, c in principal.topology.triangles.tolist():
        opposite |= {(a, b): c, (b, c): a, (c, a): b}
    first = principal.polylines()[0][:-1].tolist()
    line = first
    lines: list[Tensor] = []
    while not lines or set(line) != set(first):
        lines.append(torch.tensor(line))
        following, before = line[1:] + line[:1], line[-1:] + line[:-1]
        ahead = [opposite[v, w] for v, w in zip(line, following, strict=True)]
        behind = [opposite[u, v] for u, v in zip(before, line, strict=True)]
        line = [opposite[edge] for edge in zip(behind, ahead, strict=True)]
    return lines


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Designs, refines, measures, draws."""
    mesh = principal_triangles(SURFACE, config.rows, config.around, along="u")
    principal = principal_edges_of_lattice(mesh, "u")
    handles = equator_handles(mesh, config)
    settings = SymmetricSettings(formulation=config.formulation)  # type: ignore[arg-type]  # checked there
    maker = SymmetricDesign(mesh.vertices, principal, handles=list(handles), settings=settings)
    levels = design_levels(maker, handles, config.levels)
    start = Level(mesh.vertices, principal, {})
    results.mesh("start.obj", mesh.vertices, mesh.topology)
    for number, level in enumerate(levels):
        results.mesh(f"level_{number}.obj", level.vertices, level.topology)
    pulls_page(start, levels[0], handles, VIEW, config.width).write(results.path(DESIGN), overwrite=results.force)
    strips, strip_report = level_strips(levels[0], config.strip_height, ("strips.obj", "strips.svg"), results)
    strips_page(levels[0], strips, VIEW, config.width).write(results.path(STRIPS), overwrite=results.force)

    quads = principal_quad_mesh(levels[-1], max(1, 2 ** (config.levels - 1)))
    results.mesh("principal_quads.obj", *quads)
    reference = smooth_surface(levels[-1].vertices, levels[-1].topology, config.smooth)
    meshes = {f"{level.topology.num_vertices} vertices": (level.vertices, level.topology) for level in levels}
    meshes[QUADS] = quads
    scores = reflection_scores(meshes, reference, config.size)
    captions = {
        name: [f"$E$ = {row['normal_variation']:.2f}", f"score {row['score']:.3f}"] for name, row in scores.items()
    }
    captions[QUADS].insert(0, f"{quads[1].num_vertices} vertices")
    captions[SMOOTH] = [f"$C$ = {levels[-1].report['after']['total_absolute_curvature']:.2f}"]
    x, y, _ = reference.vertices.unbind(1)
    far = is_inside(reference) & (y > 0) & (x > 0.35 * x.max())
    cameras = whole_and_near(reference, far, VIEW, config.width, len(captions))
    draw_reflections(REFLECTIONS, meshes, reference, cameras, captions, config, results)
    return {
        "handles": handles,
        "largest_pull": largest_pull(mesh.vertices, handles),
        "levels": [level.report for level in levels],
        "strips": strip_report,
        "largest_planarity_of_quads": float(planarity(*quads).max()),
        "reflections": scores,
    }


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, files(Config()), arguments)


if __name__ == "__main__":
    sys.exit(main())
