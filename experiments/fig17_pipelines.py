"""Paper Fig. 17: the pipelines from a design surface, or its boundary alone, to an energy-minimal mesh.

Above a free-form design surface, below the surface of least absolute curvature C with the same boundary (pipeline i).
Both as irregular triangles, as the same triangles of smaller E near the surface (pipeline ii), as quads along principal
curvature lines (pipeline iii), and as the same quads planar. Under each stage stand E, its ratio to C of the surface,
and how far faces are from planar.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from _chains import Mesh, chain, draw_stages, figures_on, in_words, words_of
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _forms import solve

from torchfair.formfinding import minimise_normal_variation
from torchfair.shapes import FreeFormPatch, irregular_triangles
from torchfair.viewing import picture_edges, view_direction

NAME = "fig17_pipelines"
PICTURE = "pipelines.png"
DESIGN, LEAST = "design surface", "surface of least C"
SURFACE, FAIRED, MESHED, PLANAR = "triangles", "of smaller E", "principal quads", "planar"
STAGES = (SURFACE, FAIRED, MESHED, PLANAR)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    vertices: int = setting(1200, "vertices of the design surface", least=60)
    quads: int = setting(500, "quads, about", least=20)
    width: int = setting(2200, "columns of pixels of the picture", least=300)


def file_of(surface: str, stage: str) -> str:
    """Name of a mesh, without its extension."""
    return f"{surface} {stage}".replace(" ", "_").lower()


def stages_of(surface: Mesh, quads: int) -> tuple[dict[str, Mesh], Report]:
    """All stages of one surface, with their figures."""
    faired = minimise_normal_variation(*surface)
    made = chain(surface, quads)
    meshes = dict(zip(STAGES, [surface, (faired.vertices, faired.topology), *made.meshes().values()], strict=True))
    report = {name: figures_on(made.meshed, *mesh) for name, mesh in meshes.items()}
    return meshes, {
        "stages": report,
        "chain": made.report,
        "largest_distance": faired.after["largest_distance_relative"],
    }


def experiment(config: Config, results: Results) -> Report:
    """Both surfaces, stage by stage."""
    design = irregular_triangles(FreeFormPatch(), config.vertices, config.seed)
    least, form = solve(design.vertices, design.topology)
    surfaces: dict[str, Mesh] = {DESIGN: (design.vertices, design.topology), LEAST: (least.vertices, least.topology)}
    view = view_direction(*surfaces[DESIGN])
    rows, reports = [], {}
    for name, surface in surfaces.items():
        meshes, reports[name] = stages_of(surface, config.quads)
        rows.append(meshes)
        for stage, row in reports[name]["stages"].items():
            results.mesh(f"{file_of(name, stage)}.obj", *meshes[stage])
            print(f"{name}, {stage}: {in_words(row)}")
        picture_edges(results.path(f"{file_of(name, 'edges')}.png"), {k: v for k, (v, _) in meshes.items()},
                      [t for _, t in meshes.values()], name, view=view, width=config.width,
                      overwrite=results.force)  # fmt: skip
    draw_stages(PICTURE, rows, captions(reports), view, config.width, results)
    return {"form": form, "surfaces": reports}


def captions(reports: Report) -> dict[str, list[str]]:
    """Under every column the figures of both surfaces."""
    words: dict[str, list[str]] = {}
    for stage in STAGES:
        words[stage] = []
        for place, report in zip(("above", "below"), reports.values(), strict=True):
            energy, flat = words_of(report["stages"][stage])
            words[stage] += [f"{place}: {energy}", flat]
            if stage == SURFACE:
                words[stage][-1] += f",  $C$ = {report['stages'][stage]['total_absolute_curvature']:.2f}"
    return words


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [f"{file_of(name, stage)}.obj" for name in (DESIGN, LEAST) for stage in STAGES]
    files += [PICTURE, *(f"{file_of(name, 'edges')}.png" for name in (DESIGN, LEAST))]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
