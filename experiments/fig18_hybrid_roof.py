"""Paper Fig. 18: E of a hybrid roof of triangles and planar quads is lowered near the original.

The roof has the proportions of the paper's (the Islamic Art exhibition in the Louvre): about 1250 vertices, strips of
planar quads joined by triangles. Vertices slide along the original surface; the quads stay planar. Both formulations
run: *reduced*, with the vertices as the only unknowns, and *lifted*, with the paper's auxiliary variables as well.

The table beside the paper's row counts every quad as two triangles and the diagonal between them as an edge, as the
paper does (its quads are planar by l* = 0 on their diagonals). The headings F and E are exchanged in the paper's
Fig. 20: its roof has 3598 edges and 2352 triangles, because V - E + F = 1.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import Camera
from torchfair.constraints import lifted_normal_variation_blocks
from torchfair.formfinding import FairSettings, JobResult, Level, minimise_normal_variation
from torchfair.geometry import edge_lengths
from torchfair.shapes import hybrid_roof
from torchfair.viewing import (
    EdgeStyle,
    MeshView,
    fit_camera,
    picture_before_after,
    picture_edges,
    picture_gauss_images,
    view_direction,
)
from torchfair.viewing.lines import Surface, visible_lines
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet

NAME = "fig18_hybrid_roof"
OVERLAY, BEFORE_AFTER, EDGES, GAUSS = "overlay.png", "before_after.png", "edges.png", "gauss_images.png"
MESHES = {"original": "original.obj", "reduced": "reduced.obj", "lifted": "lifted.obj"}
TABLE = "table.txt"
RED = torch.tensor([0.84, 0.10, 0.06])
INK = torch.tensor([0.13, 0.16, 0.22])

# Fig. 20, row 18 of the paper, with the headings F and E exchanged back (C++, Intel i7-7500U, 2.7 GHz).
PAPER = {"V": 1247, "E": 3598, "F": 2352, "variables": 25000, "E_after": 11.1, "seconds_per_iteration": 0.21}


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    strips: int = setting(13, "strips of planar quads", least=2)
    columns: int = setting(47, "quads along a strip", least=2)
    irregularity: float = setting(0.3, "how far vertices start from the regular roof, 0 to below 1", least=0)
    formulations: tuple[str, ...] = setting(
        ("reduced", "lifted"), "formulations to run; the first is drawn", choices=("reduced", "lifted")
    )
    closeness_weight: float = setting(100.0, "weight of closeness to the original surface", least=0)
    distance_limit: float = setting(0.05, "largest distance from it, in mean edge lengths", least=1e-3)
    iterations: int = setting(60, "most damped steps", least=1)


# ---- the job -------------------------------------------------------------------------------------------


def run_job(vertices: Tensor, topology: Topology, config: Config, formulation: str) -> tuple[JobResult[Level], Report]:
    """Lowers E and reports what happened."""
    settings = FairSettings(
        formulation=formulation,  # type: ignore[arg-type]  # checked there
        closeness_weight=config.closeness_weight,
        distance_limit=config.distance_limit,
        planar="quads",
    )
    settings = replace(settings, projection=replace(settings.projection, max_iterations=config.iterations))
    begin, cpu = time.perf_counter(), time.process_time()
    result = minimise_normal_variation(vertices, topology, settings=settings)
    seconds, cpu = time.perf_counter() - begin, time.process_time() - cpu
    projection = result.projection
    steps = max(projection.iterations + sum(stage.iterations for stage in result.preparation), 1)
    report: Report = {
        "before": result.before,
        "after": result.after,
        "relative_change": result.after["normal_variation"] / result.before["normal_variation"] - 1,
        "unknowns": 3 * topology.num_vertices,
        "status": projection.status,
        "iterations": steps,
        "seconds": seconds,
        "seconds_per_iteration": seconds / steps,
        "cpu_seconds_per_iteration": cpu / steps,  # does not count what else the machine was doing
        "solver": projection.solver,
        "timings": projection.timings,
        "residuals": projection.residuals,
        "history": [record.as_dict() for record in projection.history],
        "notes": result.notes,
    }
    if formulation == "lifted":
        report["unknowns"] += sum(
            block.numel() for block in lifted_normal_variation_blocks(vertices, topology).values()
        )
    return result, report


def count_as_paper(topology: Topology) -> Report:
    """Sizes with every quad cut in two, and the variables of the paper: 3 V + 3 F + 4 E."""
    diagonals = int((topology.face_sizes == 4).sum())
    sizes = (topology.num_vertices, topology.num_edges + diagonals, topology.num_faces + diagonals)
    return {"V": sizes[0], "E": sizes[1], "F": sizes[2], "variables": 3 * sizes[0] + 4 * sizes[1] + 3 * sizes[2]}


def comparison_table(topology: Topology, reports: dict[str, Report]) -> str:
    """The paper's row of Fig. 20 beside ours."""
    counts = count_as_paper(topology)
    paper = [PAPER["V"], PAPER["E"], PAPER["F"], "25k", "-", PAPER["E_after"], "-", PAPER["seconds_per_iteration"]]
    rows = [
        ["", "V", "E", "F", "variables", "E before", "E after", "change", "T/iter [s]", "CPU/iter [s]", "iterations"]
    ]
    rows.append(["paper", *map(str, paper), "-", "-"])
    for name, report in reports.items():
        energies = [report[when]["normal_variation"] for when in ("before", "after")]
        row = [name, *(str(counts[key]) for key in "VEF"), str(report["unknowns"])]
        row += [f"{energy:.1f}" for energy in energies] + [f"{100 * report['relative_change']:+.1f} %"]
        row += [f"{report[key]:.3f}" for key in ("seconds_per_iteration", "cpu_seconds_per_iteration")]
        rows.append([*row, str(report["iterations"])])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    lines.append(f"counted as in the paper, 3 V + 3 F + 4 E, this roof has {counts['variables']} variables")
    return "\n".join(lines)


# ---- pictures ------------------------------------------------------------------------------------------


def draw_overlay(original: Tensor, final: Tensor, topology: Topology, width: int, results: Results) -> None:
    """The final mesh with the edges of the original in red over it, and a closer look at the middle."""
    towards_eye, up = view_direction(original, topology)
    camera, size = fit_camera(original, final, towards_eye=towards_eye, up=up, width=width - 2 * MARGIN)
    middle = (final - final.mean(0)).norm(dim=1) < 0.17 * (final - final.mean(0)).norm(dim=1).max()
    panel = (width - 2 * MARGIN - 2 * GAP) // 3
    close, close_size = fit_camera(
        final[middle], towards_eye=towards_eye, up=up, width=panel, height=round(0.8 * panel), margin=0.0
    )
    sheet = Sheet(width, size[0] + close_size[0] + 2 * CAPTION + MARGIN)
    sheet.caption("final mesh, the original in red", 0, 0, width)
    sheet.image(paint_overlay(final, original, topology, camera, size), MARGIN, CAPTION)
    below = CAPTION + size[0]
    closer = {"original": (original, None), "final": (final, None), "final, the original in red": (final, original)}
    for column, (name, (vertices, other)) in enumerate(closer.items()):
        left = MARGIN + column * (panel + GAP)
        sheet.caption(name, left, below, panel)
        sheet.image(paint_overlay(vertices, other, topology, close, close_size), left, below + CAPTION)
    sheet.write(results.path(OVERLAY), overwrite=results.force)


def paint_overlay(
    vertices: Tensor, other: Tensor | None, topology: Topology, camera: Camera, size: tuple[int, int]
) -> Tensor:
    """A shaded mesh with dark edges, and the visible edges of another one of the same topology in red."""
    mesh = MeshView(vertices, topology, camera, size)
    shaded = shade_faces(vertices, topology, camera)
    picture = mesh.paint(shaded, edges=EdgeStyle(INK, 1.1))
    if other is None:
        return picture
    height = 0.2 * edge_lengths(other, topology).mean()
    lifted = other - height * camera.view_directions(other)[0]  # not hidden by the mesh
    both = torch.cat([mesh.points, camera.project(lifted, mesh.samples)[0]])
    surface = Surface(both, mesh.triangulation.triangles, mesh.triangle_index)
    widths = torch.full((topology.num_edges,), 1.2 * mesh.supersampling)
    covered = (visible_lines(surface, topology.edges + topology.num_vertices, widths) >= 0).to(torch.float32)
    share = torch.nn.functional.avg_pool2d(covered[None, None], mesh.supersampling)[0, 0, :, :, None]
    return torch.lerp(picture, RED, share)


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Runs the job in every formulation, draws, and prints the table."""
    vertices, topology = hybrid_roof(config.strips, config.columns, irregularity=config.irregularity, seed=config.seed)
    results.mesh(MESHES["original"], vertices, topology)
    found, reports = {}, {}
    for formulation in config.formulations:
        result, reports[formulation] = run_job(vertices, topology, config, formulation)
        found[formulation] = result.vertices
        results.mesh(MESHES[formulation], result.vertices, topology)
        after = result.after
        print(
            f"{formulation}: E {result.before['normal_variation']:.4g} to {after['normal_variation']:.4g}, "
            f"{after['largest_distance_relative']:.3f} mean edges from the original at most, relative planarity "
            f"{after['largest_planarity']:.1e}, {result.projection.iterations} steps: {result.projection.message}"
        )
    table = comparison_table(topology, reports)
    print(table)
    results.text(TABLE, table + "\n")
    final = found[config.formulations[0]]
    draw_overlay(vertices, final, topology, config.width, results)
    page: Report = {"width": config.width, "overwrite": results.force}
    picture_before_after(results.path(BEFORE_AFTER), vertices, final, topology, **page)
    picture_edges(results.path(EDGES), {"original": vertices, "final": final}, topology, **page)
    picture_gauss_images(results.path(GAUSS), vertices, final, topology, **page)
    sizes = {"V": topology.num_vertices, "E": topology.num_edges, "F": topology.num_faces}
    kinds = {"triangles": int((topology.face_sizes == 3).sum()), "quads": int((topology.face_sizes == 4).sum())}
    return {"sizes": sizes | kinds, "sizes_as_in_paper": count_as_paper(topology), "paper": PAPER} | {
        "formulations": reports
    }


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [OVERLAY, BEFORE_AFTER, EDGES, GAUSS, TABLE, *MESHES.values()]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
