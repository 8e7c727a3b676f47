"""Paper Fig. 21: a surface of least absolute curvature C with four openings, and its principal remeshing.

A hall with an oval rim that rises and falls, and four round skylights: five boundary curves as in the paper, whose mesh
has the same Euler number, -3. The surface of least C, its absolute curvature (white is zero), and quads along its
principal curvature lines with edges coloured by length times dihedral angle, beside those of the triangles.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

from _chains import PLANAR, QUADS, chain, direction, figures_on, in_words
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _forms import closed_curve, solve

from torchfair.curves import ClosedCurve
from torchfair.formfinding import start_surface
from torchfair.viewing import picture_curvature, picture_edges, picture_principal_mesh

NAME = "fig21_principal_remeshing"
CURVATURE, EDGES, MESH = "curvature.png", "edges.png", "mesh.png"
SURFACE = "surface of least C"
FILES = {SURFACE: "surface.obj", QUADS: "principal_quads.obj", PLANAR: "planar_quads.obj"}
VIEW = direction(-0.35, -1.0, 0.75)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    vertices: int = setting(650, "vertices of the start, about", least=150)
    levels: int = setting(1, "how often it is refined", least=0)
    quads: int = setting(1200, "quads, about", least=20)


def hall() -> list[ClosedCurve]:
    """The rim and the skylights."""
    rim = closed_curve(lambda a: (2.2 * a.cos(), 1.5 * a.sin(), 0.25 * (1.0 - (2 * a).cos())))
    return [rim, *(_skylight(x, y) for x in (-1.1, 1.1) for y in (-0.45, 0.45))]


def _skylight(x: float, y: float) -> ClosedCurve:
    return closed_curve(lambda a: (x + 0.28 * a.cos(), y + 0.28 * a.sin(), 1.0))


def experiment(config: Config, results: Results) -> Report:
    """The surface, its meshes, figures and pictures."""
    curves = hall()
    found, form = solve(*start_surface(curves, config.vertices), curves=curves, levels=config.levels)
    surface = (found.vertices, found.topology)
    quads = chain(surface, config.quads)
    meshes = {SURFACE: surface, **quads.meshes()}
    report = {name: figures_on(quads.meshed, *mesh) for name, mesh in meshes.items()}
    for name, row in report.items():
        results.mesh(FILES[name], *meshes[name])
        print(f"{name}: {in_words(row)}")
    same: dict[str, Any] = {"view": VIEW, "width": config.width, "overwrite": results.force}
    picture_curvature(results.path(CURVATURE), [(SURFACE, *surface)], **same)
    picture_edges(results.path(EDGES), {name: v for name, (v, _) in meshes.items() if name != QUADS},
                  [t for name, (_, t) in meshes.items() if name != QUADS], **same)  # fmt: skip
    made = quads.planar
    picture_principal_mesh(results.path(MESH), made.vertices, made.topology, made.singular_points,
                           made.singular_indices, **same)  # fmt: skip
    return {"form": form, "chain": quads.report, "meshes": report}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [CURVATURE, EDGES, MESH, *FILES.values()], arguments)


if __name__ == "__main__":
    sys.exit(main())
