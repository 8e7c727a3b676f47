"""Guided projection as the paper prints it beside the jobs as they are, one difference after the other.

Run ``python benchmarks/bench_printed.py [--jobs fair form symmetric] [--json FILE]``, on one thread.

Every row of a mesh has all differences of the rows before it: the first is the preset ``paper`` with the paper's
weights, the last the default settings of the job. *Rises* counts steps that raised the merit; only the printed one
takes such steps. Seconds are processor time of the whole call. The residual of principal-symmetric meshes is the
largest relative one of the conditions; the share of saddle sides is that of negatively curved stars whose principal
neighbours are on the right side.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from barrel_problem import barrel
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.formfinding import (
    FairSettings,
    FormSettings,
    JobResult,
    SymmetricSettings,
    minimise_absolute_curvature,
    minimise_normal_variation,
    principal_symmetric,
    start_surface,
)
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import Catenoid, Enneper, Torus, builtin_mesh, irregular_triangles, principal_triangles
from torchfair.shapes.shape_mesh import ShapeMesh

Mesh = tuple[Tensor, Topology]
Solve = Callable[[Any], JobResult[Any]]
_NOISE = 0.03

MEASURES = {
    "fair": ("normal_variation", "smallest_angle_degrees", "largest_distance_relative", "largest_planarity"),
    "form": ("total_absolute_curvature", "smallest_angle_degrees", "folded_faces"),
    "symmetric": ("largest_residual", "saddle_side_share", "smallest_angle_degrees", "flipped_faces"),
}


def fair_ladder() -> Iterator[tuple[str, FairSettings]]:
    ours = FairSettings()
    settings = FairSettings.paper()
    yield "as printed", settings
    settings = replace(
        settings,
        energy_weight=ours.energy_weight,
        closeness_weight=ours.closeness_weight,
        fairness_weight=ours.fairness_weight,
        boundary_weight=ours.boundary_weight,
        flat_weight=ours.flat_weight,
        constraint_weight=ours.constraint_weight,
        projection=replace(settings.projection, initial_damping=ours.projection.initial_damping, max_iterations=80),
    )
    yield "our weights", settings
    settings = replace(settings, projection=ours.projection)
    yield "judged steps, damping that follows", settings
    settings = replace(settings, formulation="reduced", planarity_weight=ours.planarity_weight)
    yield "vertices as unknowns, reweighted", settings
    settings = replace(settings, second_differences=False)
    yield "umbrella vectors", settings
    settings = replace(settings, quality_weight=ours.quality_weight, distance_limit=ours.distance_limit)
    yield "barriers and guards", settings
    yield "stages from blunt to sharp (ours)", ours


def form_ladder() -> Iterator[tuple[str, FormSettings]]:
    ours = FormSettings()
    settings = FormSettings.paper()
    yield "as printed", settings
    settings = replace(settings, constraint_weight=ours.constraint_weight)
    yield "constraints weigh 1000", settings
    settings = replace(
        settings,
        curvature_weight=ours.curvature_weight,
        umbrella_weight=ours.fairness_weight,
        projection=replace(settings.projection, max_iterations=40),
    )
    yield "our weights", settings
    settings = replace(settings, projection=ours.projection)
    yield "judged steps, damping that follows", settings
    settings = replace(settings, umbrella_weight=0.0, fairness_weight=ours.fairness_weight)
    yield "fairness that leaves even bending", settings
    settings = replace(settings, coarse_smoothing=ours.coarse_smoothing, absolute_value="smooth")
    yield "smoothing from coarse to fine", settings
    yield "vertices as unknowns, along normals first (ours)", ours


def symmetric_ladder() -> Iterator[tuple[str, SymmetricSettings]]:
    ours = SymmetricSettings()
    settings = SymmetricSettings.paper()
    yield "as printed", settings
    settings = replace(
        settings,
        constraint_weight=ours.constraint_weight,
        fairness_weight=ours.fairness_weight,
        closeness_weight=ours.closeness_weight,
        projection=replace(settings.projection, initial_damping=ours.projection.initial_damping, max_iterations=60),
    )
    yield "our weights", settings
    settings = replace(settings, second_differences=False, anchor_weight=ours.anchor_weight)
    yield "fairness of the displacement", settings
    settings = replace(settings, projection=replace(ours.projection, max_iterations=60))
    yield "judged steps, damping that follows", settings
    settings = replace(settings, formulation="spheres", saddle_weight=ours.saddle_weight)
    yield "spheres that may be planes, saddle sides heeded", settings
    yield "barriers, rounds, conditions alone at last (ours)", ours


def both(mesh: ShapeMesh) -> Mesh:
    return mesh.vertices, mesh.topology


def ring(height: float, radius: float, wave: float = 0.0) -> ClosedCurve:
    """A circle, or one that goes up and down twice."""
    angle = torch.linspace(0.0, 2.0 * math.pi, 81, dtype=torch.float64)[:-1]
    return ClosedCurve(
        torch.stack([radius * angle.cos(), radius * angle.sin(), height + wave * (2.0 * angle).cos()], dim=1)
    )


def shaken(mesh: ShapeMesh) -> tuple[Tensor, PrincipalEdges]:
    generator = torch.Generator().manual_seed(0)
    noise = torch.randn(mesh.vertices.shape, dtype=mesh.vertices.dtype, generator=generator)
    return mesh.vertices + _NOISE * noise, principal_edges_of_lattice(mesh, "u")


def fair(mesh: Mesh) -> Solve:
    return lambda settings: minimise_normal_variation(*mesh, settings=settings)


def form(mesh: Mesh) -> Solve:
    return lambda settings: minimise_absolute_curvature(*mesh, settings=settings)


def symmetric(mesh: ShapeMesh) -> Solve:
    vertices, principal = shaken(mesh)
    reference = (mesh.vertices, mesh.topology)
    return lambda settings: principal_symmetric(vertices, principal, reference=reference, settings=settings)


JOBS: dict[str, tuple[Callable[[], Iterator[tuple[str, Any]]], dict[str, Callable[[], Solve]]]] = {
    "fair": (
        fair_ladder,
        {
            "example roof": lambda: fair(builtin_mesh("roof")),
            "example hybrid_roof": lambda: fair(builtin_mesh("hybrid_roof")),
            "Enneper, irregular": lambda: fair(both(irregular_triangles(Enneper(), 400))),
            "torus, irregular": lambda: fair(both(irregular_triangles(Torus(2.0, 0.8), 800))),
        },
    ),
    "form": (
        form_ladder,
        {
            "barrel to cylinder": lambda: form(barrel(555)),
            "between a wave and a circle": lambda: form(start_surface([ring(0.0, 1.0, 0.2), ring(1.0, 0.7)], 500)),
        },
    ),
    "symmetric": (
        symmetric_ladder,
        {
            "torus, shaken": lambda: symmetric(principal_triangles(Torus(2.0, 0.8), 16, 30)),
            "catenoid, shaken": lambda: symmetric(principal_triangles(Catenoid(), 12, 24, ends="zigzag")),
        },
    ),
}


def measured(result: JobResult[Any], job: str) -> dict[str, float]:
    """What a row shows, of the start and of the result."""
    rows: dict[str, float] = {}
    for when, values in (("before", result.before), ("after", result.after)):
        if job == "symmetric":
            values = {**values, "largest_residual": max(values["largest_cospherical"], values["largest_coplanar"])}
        rows |= {f"{name}_{when}": float(values[name]) for name in MEASURES[job]}
    return rows


def rises(result: JobResult[Any]) -> int:
    """Steps that raised the merit."""
    pairs = [pair for run in result.runs for pair in zip(run.history, run.history[1:], strict=False)]
    return sum(after.merit > before.merit for before, after in pairs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", nargs="+", choices=JOBS, default=list(JOBS))
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows = []
    for job in options.jobs:
        ladder, meshes = JOBS[job]
        for mesh, make in meshes.items():
            solve = make()
            print(f"\n{job}: {mesh}")
            print(f"{'':50}" + "".join(f"{name[-24:]:>26}" for name in MEASURES[job]) + "  steps rises  seconds status")
            for step, settings in ladder():
                begin = time.process_time()
                result = solve(settings)
                seconds, found = time.process_time() - begin, measured(result, job)
                shown = "".join(
                    f"{found[f'{name}_before']:13.4g}{found[f'{name}_after']:13.4g}" for name in MEASURES[job]
                )
                status = result.projection.status.name
                print(f"{step:50}{shown}{result.steps:7}{rises(result):6}{seconds:9.2f} {status}", flush=True)
                row = {"job": job, "mesh": mesh, "settings": step, "steps": result.steps, "rises": rises(result)}
                rows.append({**row, "seconds": seconds, "status": status, **found})
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
