"""Gradients of finished meshes: time and products of the backward pass, beside a solve and beside unrolling.

Run ``python benchmarks/bench_job_layer.py [--jobs fair form symmetric] [--json FILE]``, on one thread.

For one job each, with two handles: processor time of the whole job and of the way from its end to the minimum; time of
a backward pass and its products with the exact second derivatives; the same by unrolling 10 and 40 Gauss-Newton steps,
with the error of that gradient; and what central differences by finishing the mesh again from its minimum take for as
many coordinates, with the error of the implicit gradient against them.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from torchfair.curves import ClosedCurve
from torchfair.errors import DerivativeError
from torchfair.formfinding import FairRecipe, FairSettings, FormRecipe, JobLayer, Recipe, SymmetricRecipe, start_surface
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Paraboloid, Torus, parameter_quads, principal_triangles

JOBS = ("fair", "form", "symmetric")


def ring(radius: float, height: float) -> ClosedCurve:
    turn = torch.arange(40, dtype=torch.float64) * (math.tau / 40)
    return ClosedCurve(torch.stack([radius * turn.cos(), radius * turn.sin(), height + 0.2 * (2 * turn).sin()], dim=1))


def pulled(vertices: Tensor, chosen: list[int], way: Tensor) -> dict[int, list[float]]:
    return dict(zip(chosen, (vertices[chosen] + way).tolist(), strict=True))


def recipe(job: str) -> Recipe[Any]:
    """The job with two handles."""
    if job == "fair":
        mesh = parameter_quads(Paraboloid(1.0, -1.0), 12, 12)
        handles = pulled(mesh.vertices, [58, 110], mesh.vertices.new_tensor([0.0, 0.0, 0.1]))
        settings = FairSettings(boundary="fixed", smoothing=0.1)
        return FairRecipe(mesh.vertices, mesh.topology, handles=handles, settings=settings)
    if job == "form":
        vertices, topology = start_surface([ring(2.0, 0.0), ring(0.8, 0.8)], 150)
        inside = torch.nonzero(~topology.is_boundary_vertex).squeeze(1)
        return FormRecipe(
            vertices,
            topology,
            handles=pulled(vertices, inside[[5, 40]].tolist(), vertices.new_tensor([0.0, 0.0, 0.05])),
        )
    mesh = principal_triangles(Torus(2.0, 1.0), 10, 14, along="u")
    handles = dict(zip([40, 80], (1.08 * mesh.vertices[[40, 80]]).tolist(), strict=True))
    return SymmetricRecipe(mesh.vertices, principal_edges_of_lattice(mesh, "u").check(), handles=handles)


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.process_time()
    return work(), time.process_time() - begin


def judged(mesh: Tensor) -> Tensor:
    """Some number that depends on all vertices."""
    wave = torch.linspace(0.0, 5.0, mesh.numel(), dtype=mesh.dtype).cos().view_as(mesh)
    return (wave * mesh).sum() + mesh.square().sum()


def measured(job: str) -> dict[str, Any]:
    """Times and errors of one job."""
    made, row = recipe(job), {}
    targets = torch.tensor(list(made.handles.values()), dtype=torch.float64, requires_grad=True)
    layer = JobLayer(made, tolerance=1e-9)
    (mesh, info), row["solve_seconds"] = timed(lambda: layer({"targets": targets}))
    row |= {"vertices": made.topology.num_vertices, "job_steps": sum(run.iterations for run in info.runs)}
    row |= {"newton_steps": info.steps, "newton_products": info.products}
    row["job_seconds"] = sum(run.timings["total"] for run in info.runs)
    (exact,), row["backward_seconds"] = timed(lambda: torch.autograd.grad(judged(mesh), targets))
    row["products"], start = info.adjoint.products, mesh.detach()
    for steps in (10, 40):
        rough = JobLayer(made, tolerance=1e-9, backward="unroll", unrolled_steps=steps)
        other, _ = rough({"targets": targets}, start=start)
        try:
            (slope,), seconds = timed(lambda: torch.autograd.grad(judged(other), targets))  # noqa: B023
            error = float((slope - exact).norm() / exact.norm())
        except DerivativeError:
            seconds = error = math.nan
        row[f"unrolled_{steps}_seconds"], row[f"unrolled_{steps}_error"] = seconds, error

    def differences() -> Tensor:
        slope, step = torch.zeros_like(exact), 1e-5 * made.unit.length
        for number in range(exact.numel()):
            sides = []
            for sign in (1.0, -1.0):
                there = targets.detach().clone()
                there.view(-1)[number] += sign * step
                sides.append(float(judged(layer({"targets": there}, start=start)[0])))
            slope.view(-1)[number] = (sides[0] - sides[1]) / (2 * step)
        return slope

    slope, row["differences_seconds"] = timed(differences)
    row["error"] = float((slope - exact).norm() / slope.norm())
    return row


def main() -> None:
    """Measures all jobs that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", nargs="+", choices=JOBS, default=JOBS)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows = {}
    for job in options.jobs:
        rows[job] = measured(job)
        print(f"{job}: " + ", ".join(f"{name} {value:.3g}" for name, value in rows[job].items()), flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
