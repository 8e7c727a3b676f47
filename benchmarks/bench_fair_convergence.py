"""How long the job that lowers E takes to come near its best, with the settings it had at first beside those of today.

Run ``python benchmarks/bench_fair_convergence.py [--json FILE]``, on one thread.

The meshes are made by the library. *Plain* is what the job did before: the sharp absolute value alone, no second-order
corrections, a stop where the merit fell by less than a thousandth in each of three steps. *Staged* is the default. Both
run in this one process, on the same smooth boundary curves. The best E is that of whichever side ends lower after
``--long`` more steps; the time is that at which E first is within 1 % of the way between it and the start.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.projection import IterationRecord, ProjectionSettings
from torchfair.shapes import Catenoid, Enneper, Torus, builtin_mesh, irregular_triangles, principal_triangles
from torchfair.shapes.shape_mesh import ShapeMesh

Mesh = tuple[Tensor, Topology]

MESHES: dict[str, Callable[[], Mesh]] = {
    "Enneper, irregular": lambda: both(irregular_triangles(Enneper(), 400)),
    "torus, irregular": lambda: both(irregular_triangles(Torus(2.0, 0.8), 800)),
    "catenoid, principal": lambda: both(principal_triangles(Catenoid(), 12, 24)),
    "example roof": lambda: builtin_mesh("roof"),
    "example hybrid_roof": lambda: builtin_mesh("hybrid_roof"),
}
PLAIN = FairSettings(
    continuation=(),
    projection=ProjectionSettings(
        max_iterations=60,
        initial_damping=0.1,
        damping_scale="identity",
        merit_tolerance=1e-3,
        patience=3,
        least_uncorrected_gain=-math.inf,
        when_settled="stop",
    ),
)


def both(mesh: ShapeMesh) -> Mesh:
    """Vertices and topology."""
    return mesh.vertices, mesh.topology


SIDES = {"plain": PLAIN, "staged": FairSettings()}


@dataclass
class Track:
    """E over processor time of one run."""

    times: list[float]
    energies: list[float]
    steps: int

    def time_to(self, energy: float) -> float:
        """When E first was as low; infinity if it never was."""
        reached = (t for t, e in zip(self.times, self.energies, strict=True) if e <= energy)
        return next(reached, math.inf)


def run(mesh: Mesh, settings: FairSettings) -> Track:
    begin, times, energies = time.process_time(), [], []

    def note(record: IterationRecord) -> None:
        times.append(time.process_time() - begin)
        energies.append(record.quantities["normal_variation"])

    result = minimise_normal_variation(*mesh, settings=settings, callback=note)
    return Track(times, energies, sum(stage.iterations for stage in (*result.preparation, result.projection)))


def longer(settings: FairSettings, steps: int) -> FairSettings:
    projection = replace(settings.projection, max_iterations=steps, merit_tolerance=0.0, patience=10**6)
    return replace(settings, projection=projection)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", type=int, default=300, help="steps of the run that finds the best E")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(1)
    print(f"{'mesh':22}{'E':>9}{'best':>9} |{'plain E':>9}{'steps':>6}{'s':>7}{'to 1 %':>8} |", end="")
    print(f"{'staged E':>9}{'steps':>6}{'s':>7}{'to 1 %':>8}")
    rows = []
    for name, make in MESHES.items():
        mesh = make()
        tracks = {side: run(mesh, settings) for side, settings in SIDES.items()}
        best = min(run(mesh, longer(settings, options.long)).energies[-1] for settings in SIDES.values())
        start = tracks["plain"].energies[0]
        near = best + 0.01 * (start - best)
        print(f"{name:22}{start:9.3f}{best:9.3f}", end="")
        row: dict[str, Any] = {"mesh": name, "start": start, "best": best}
        for side, track in tracks.items():
            row[side] = {
                "energy": track.energies[-1],
                "steps": track.steps,
                "seconds": track.times[-1],
                "seconds_to_1_percent": track.time_to(near),
            }
            print(f" |{track.energies[-1]:9.3f}{track.steps:6}{track.times[-1]:7.2f}{track.time_to(near):8.2f}", end="")
        print(flush=True)
        rows.append(row)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
