"""Live sessions: how long a designer waits when a handle is dragged.

Run ``python benchmarks/bench_sessions.py [--jobs fair form symmetric] [--sizes 480 714 1920] [--json FILE]``, on one
thread.

A session is opened (problem, index maps, analysis, first measures, first step), a handle is dragged by a tenth of a
mean edge in each of twenty moves, one accepted step for each, and let go. Surfaces of least C are those of an annulus
between two rings, found before the handle is dragged; the others start from the rings of table 20. Times are processor
time: of opening, the median and the largest of the moves, and from release to rest. ``lag`` is the largest distance of
the handle from its target after a move, in mean edges; ``accepted`` the share of damped steps that were not refused.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from symmetric_problems import SHAPES

from torchfair.curves import ClosedCurve
from torchfair.formfinding import FairRecipe, FormRecipe, Recipe, Session, SymmetricRecipe, start_surface
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import principal_triangles

MOVES, STRIDE = 20, 0.1  # mean edges
TARGETS = {  # seconds to open, of a move, to rest
    ("fair", 480): (0.3, 0.040, 0.15),
    ("fair", 714): (0.4, 0.055, 0.2),
    ("fair", 1920): (1.0, 0.110, 0.25),
    ("form", 480): (0.3, 0.045, None),
    ("form", 714): (0.4, 0.060, None),
    ("form", 1920): (1.0, 0.140, None),
    ("symmetric", 480): (0.3, 0.090, 0.45),
    ("symmetric", 714): (0.4, 0.105, 0.8),
    ("symmetric", 1920): (1.0, 0.320, 3.0),
}


def ring(radius: float, height: float) -> ClosedCurve:
    angle = torch.arange(48, dtype=torch.float64) * (math.tau / 48)
    return ClosedCurve(torch.stack([radius * angle.cos(), radius * angle.sin(), 0.0 * angle + height], 1))


def recipe(job: str, size: int) -> Recipe[Any]:
    """The job on the ring with so many vertices, about."""
    if job == "form":
        return FormRecipe(*start_surface([ring(2.0, 0.0), ring(0.8, 0.3)], size))
    shape = SHAPES[size]
    mesh = principal_triangles(shape.surface, shape.rows, shape.columns, along="u")
    if job == "fair":
        return FairRecipe(mesh.vertices, mesh.topology)
    return SymmetricRecipe(mesh.vertices, principal_edges_of_lattice(mesh, "u").check())


def timed(work: Callable[[], object]) -> tuple[float, Any]:
    begin = time.process_time()
    value = work()
    return time.process_time() - begin, value


def opened(job: str, size: int) -> Session[Any]:
    session = Session(recipe(job, size))
    session.measures()
    session.step()
    return session


def run(job: str, size: int) -> dict[str, Any]:
    opening, session = timed(lambda: opened(job, size))
    if job == "form":
        session.solve()
        session.step()
    topology, unit = session.recipe.topology, session.recipe.unit.length
    inner = torch.nonzero(~topology.is_boundary_vertex).squeeze(1)
    handle = int(inner[inner.numel() // 3])
    way = torch.tensor([0.3, 0.2, 1.0], dtype=torch.float64)
    start, stride = session.vertices[handle].clone(), STRIDE * unit * way / way.norm()
    seconds, lags, trials = [], [], []
    for number in range(1, MOVES + 1):
        place = start + number * stride

        def move(place: torch.Tensor = place) -> Any:
            session.move({handle: place.tolist()})
            return session.step()

        duration, progress = timed(move)
        seconds.append(duration)
        trials.append(progress.trials)
        lags.append(float((session.vertices[handle] - place).norm()) / unit)
    resting, _ = timed(session.settle)
    return {
        "job": job,
        "vertices": topology.num_vertices,
        "opening": opening,
        "move": statistics.median(seconds),
        "slowest": max(seconds),
        "accepted": len(trials) / sum(trials),
        "lag": max(lags),
        "rest": resting,
        "steps to rest": session.runs[-1].iterations,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", nargs="+", default=["fair", "form", "symmetric"], help="default: all")
    parser.add_argument("--sizes", nargs="+", type=int, default=[480, 714, 1920], help="vertices (default: all)")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(1)
    opened("fair", 480)  # what a process does only once
    titles = ("open s", 13), ("move ms", 11), ("slowest", 8), ("rest s", 12), ("lag", 7), ("accepted", 9)
    print(f"{'job':>10} {'size':>5} " + " ".join(f"{title:>{width}}" for title, width in titles))
    rows = []
    for job in options.jobs:
        for size in options.sizes:
            row = run(job, size)
            rows.append(row)
            open_most, move_most, rest_most = TARGETS.get((job, size), (None, None, None))
            words = [
                f"{row['opening']:.2f}/{open_most}",
                f"{1e3 * row['move']:.0f}/{1e3 * move_most:.0f}" if move_most else f"{1e3 * row['move']:.0f}",
                f"{1e3 * row['slowest']:.0f}",
                f"{row['rest']:.2f}/{rest_most}",
            ]
            print(
                f"{job:>10} {size:>5} {words[0]:>13} {words[1]:>11} {words[2]:>8} {words[3]:>12} {row['lag']:7.4f} "
                f"{row['accepted']:9.2f}",
                flush=True,
            )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
