"""Many small problems at once: ``solve_batch`` against one solve after the other.

Run ``python benchmarks/bench_batch.py [--cases 64x50 16x2000] [--json FILE]``, on one thread.

Every member is a noisy torus (see ``torus_problem.py``) with its own noise; tolerances are off, so that both sides
make the same steps. The loop has its symbolic analysis made before, the batch once with all set-up (fresh) and once
with what it keeps (again). The largest difference of vertices says that both do the same; over many steps of a merit
with kinks rounding grows, so it is taken after five. Times are processor time.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import torch
from torus_problem import torus_problem

from torchfair.projection import GuidedProjection, ProjectionSettings

TARGETS = {"64x50": 10.0, "16x2000": 1.5}


def settings(steps: int) -> ProjectionSettings:
    return ProjectionSettings(
        max_iterations=steps,
        initial_damping=0.1,
        damping_scale="identity",
        merit_tolerance=0.0,
        patience=10**6,
    )


def run(members: int, size: int, steps: int, repeats: int) -> dict[str, Any]:
    start, terms = torus_problem(size)
    generator = torch.Generator().manual_seed(0)
    vertices = start["vertices"]
    noise = 0.05 * torch.randn(members, *vertices.shape, dtype=vertices.dtype, generator=generator)
    batch = {"vertices": vertices + noise}
    single = GuidedProjection(start, terms)
    few = settings(5)
    together = single.solve_batch(batch, settings=few)
    alone = [single.solve({"vertices": member}, settings=few) for member in batch["vertices"]]
    pairs = zip(together, alone, strict=True)
    difference = max(float((a.blocks["vertices"] - b.blocks["vertices"]).abs().max()) for a, b in pairs)
    times: dict[str, list[float]] = {"loop": [], "fresh": [], "again": []}
    for _ in range(repeats):
        begin = time.process_time()
        for member in batch["vertices"]:
            single.solve({"vertices": member}, settings=settings(steps))
        times["loop"].append(time.process_time() - begin)
        problem = GuidedProjection(start, terms)
        for name in ("fresh", "again"):
            begin = time.process_time()
            problem.solve_batch(batch, settings=settings(steps))
            times[name].append(time.process_time() - begin)
    least = {name: min(values) for name, values in times.items()}
    return {"members": members, "vertices": vertices.shape[0], "steps": steps, "difference": difference, **least}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", nargs="+", default=list(TARGETS), help="members x vertices (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(1)
    print(f"{'case':>10} {'loop s':>9} {'fresh s':>9} {'again s':>9} {'ratios':>14} {'target':>7} {'difference':>11}")
    rows = []
    for case in options.cases:
        members, size = map(int, case.split("x"))
        row = run(members, size, options.steps, options.repeats)
        rows.append(row)
        ratios = [row["loop"] / row[name] for name in ("fresh", "again")]
        numbers = " ".join(f"{row[name]:9.2f}" for name in ("loop", "fresh", "again"))
        target = f"{TARGETS[case]:7.1f}" if case in TARGETS else f"{'-':>7}"
        print(f"{case:>10} {numbers} {ratios[0]:6.1f} {ratios[1]:6.1f} {target} {row['difference']:11.1e}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
