"""Paper Fig. 14 (h): conditions on chosen principal polylines only, E lowered elsewhere.

The same torus of 480 vertices as in ``fig14_design.py``. The highlighted vertices, on four circles around the axis, are
put on the loop of a nodoid: a narrow neck inside, a broad flank, and an edge-like rim outside. The principal-symmetric
conditions hold along these four polylines only; everywhere else the mesh lowers E. The result is refined by Loop
subdivision and solved again. Coarse and refined mesh mirror the same stripes as a smooth reference surface (the
refined mesh, refined further and shaded with vertex normals), to be compared with ``fig14_design.py``, where the
conditions hold everywhere.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _designs import Handles, Level, design_levels, largest_pull, pulls_page
from _reflected_designs import (
    SMOOTH,
    draw_reflections,
    is_inside,
    reflection_scores,
    smooth_surface,
    whole_and_near,
)
from torch import Tensor

from torchfair.formfinding import SymmetricDesign, SymmetricSettings
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import ShapeMesh, Torus, principal_triangles
from torchfair.viewing import ViewDirection

NAME = "fig14h_polylines"
DESIGN, REFLECTIONS = "design.png", "reflections.png"
SURFACE = Torus(2.0, 0.8)
CIRCLES = {0.0: (3.6, 0.0), math.pi / 2: (1.6, 0.95), math.pi: (1.0, 0.0), 3 * math.pi / 2: (1.6, -0.95)}
"""Radius and height that the circle of each tube angle is pulled to."""
VIEW = ViewDirection(torch.tensor([0.35, -0.9, 1.1]), torch.tensor([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    around: int = setting(30, "cells around the axis", least=6)
    rows: int = setting(16, "rows of triangles around the tube; a multiple of four", least=8)
    spacing: int = setting(1, "every so many vertices of a highlighted circle there is a handle", least=1)
    energy_weight: float = setting(0.03, "weight of E", least=0)
    levels: int = setting(1, "how often the design is refined", least=0)
    smooth: int = setting(1, "how often the finest level is refined for the smooth reference", least=0)
    frequency: float = setting(1.2, "stripe pairs per unit of the mirrored direction", least=0.1)
    size: int = setting(256, "rows and columns of the pictures that are scored", least=32)
    joints: float = setting(0.35, "opacity of the joints between panels", least=0.0)
    width: int = setting(2200, "columns of pixels of rendered pictures", least=300)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows % 4:
            raise ValueError(f"rows must be a multiple of four, got {self.rows}")


def files(config: Config) -> list[str]:
    """Names of all files for some settings."""
    return [DESIGN, REFLECTIONS, "start.obj", *(f"level_{level}.obj" for level in range(config.levels + 1))]


def circles(mesh: ShapeMesh) -> dict[float, Tensor]:
    """The vertices of the chosen circles, in order around the axis."""
    u, v = mesh.parameters.unbind(1)
    chosen = {angle: torch.nonzero((v - angle).abs() < 1e-9).squeeze(1) for angle in CIRCLES}
    return {angle: line[u[line].argsort()] for angle, line in chosen.items()}


def nodoid_handles(mesh: ShapeMesh, spacing: int) -> Handles:
    """Where the highlighted vertices go."""
    handles = {}
    for angle, line in circles(mesh).items():
        radius, height = CIRCLES[angle]
        for vertex in line[::spacing].tolist():
            turn = float(mesh.parameters[vertex, 0])
            handles[vertex] = [radius * math.cos(turn), radius * math.sin(turn), height]
    return handles


def highlighted(level: Level, on: Tensor) -> Level:
    """The level with the principal edges on the chosen polylines only, for pictures."""
    chosen = level.principal.mask & torch.isin(level.topology.edges, on).all(1)
    return replace(level, principal=PrincipalEdges(level.topology, chosen))


def experiment(config: Config, results: Results) -> Report:
    """Designs, refines, measures, draws."""
    mesh = principal_triangles(SURFACE, config.rows, config.around, along="u")
    principal = principal_edges_of_lattice(mesh, "u")
    handles, on = nodoid_handles(mesh, config.spacing), torch.cat(list(circles(mesh).values()))
    settings = SymmetricSettings(energy_weight=config.energy_weight)
    maker = SymmetricDesign(mesh.vertices, principal, handles=list(handles), on=on, settings=settings)
    levels = design_levels(maker, handles, config.levels)
    results.mesh("start.obj", mesh.vertices, mesh.topology)
    for number, level in enumerate(levels):
        results.mesh(f"level_{number}.obj", level.vertices, level.topology)
    start, coarse = (highlighted(level, on) for level in (Level(mesh.vertices, principal, {}), levels[0]))
    pulls_page(start, coarse, handles, VIEW, config.width).write(results.path(DESIGN), overwrite=results.force)

    reference = smooth_surface(levels[-1].vertices, levels[-1].topology, config.smooth)
    meshes = {f"{level.topology.num_vertices} vertices": (level.vertices, level.topology) for level in levels}
    scores = reflection_scores(meshes, reference, config.size)
    captions = {
        name: [f"$E$ = {row['normal_variation']:.2f}", f"score {row['score']:.3f}"] for name, row in scores.items()
    }
    captions[SMOOTH] = [f"$C$ = {levels[-1].report['after']['total_absolute_curvature']:.2f}"]
    x, y, z = reference.vertices.unbind(1)
    near = is_inside(reference) & (y > 0.1 * y.max()) & (z > 0) & (x.abs() < 0.4 * x.max())
    cameras = whole_and_near(reference, near, VIEW, config.width, len(captions))
    draw_reflections(REFLECTIONS, meshes, reference, cameras, captions, config, results)
    return {
        "handles": handles,
        "largest_pull": largest_pull(mesh.vertices, handles),
        "conditions_at": len(on),
        "levels": [level.report for level in levels],
        "reflections": scores,
    }


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, files(Config()), arguments)


if __name__ == "__main__":
    sys.exit(main())
