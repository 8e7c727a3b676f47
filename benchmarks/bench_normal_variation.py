"""Normal variation, forward and backward: the library against the plain torch formula and a peer's.

Run from the repository root::

    python benchmarks/bench_normal_variation.py --threads 2 --json normal_variation.json

Rows, all on one triangle mesh of a torus with vertices shaken along the surface:

- ``torchfair``: ``normal_variation(vertices, topology).backward()``; with the optional package numba by compiled loops.
- ``without numba``: the same by torch operations, where numba is there.
- ``plain``: E written with torch operations, differentiated by autograd. Same value, same gradient (checked).
- ``normal consistency``: PyTorch3D's formula, the mean of 1 - cos over edges, likewise. Another energy of the
  same normals, without lengths: what a user of that library pays.

They take turns within every repeat, so that whatever else the machine does meets them alike. Times are
given as the smallest and the median of the repeats, ratios as ratio of the smallest and median of the ratios
within a repeat. ``--clock processor`` counts processor time of all threads, for a machine that does other things.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.energies import _normal_variation_compiled as compiled
from torchfair.energies import normal_variation

Energy = Callable[[Tensor], Tensor]
Clock = Callable[[], float]


def shaken_torus(vertex_count: int, seed: int = 0) -> tuple[Tensor, Topology]:
    """Triangles on a torus of radii 3 and 1, twice as many rows around the axis as across."""
    columns = round(math.sqrt(vertex_count / 2))
    rows = vertex_count // columns
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a, b, c, d = ((i + p) % rows * columns + (j + q) % columns for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    shake = np.random.default_rng(seed).uniform(-0.3, 0.3, (2, rows, columns))
    around, across = 2 * np.pi * (i + shake[0]) / rows, 2 * np.pi * (j + shake[1]) / columns
    distance = 3 + np.cos(across)
    points = np.stack([distance * np.cos(around), distance * np.sin(around), np.sin(across)], axis=-1)
    return torch.from_numpy(points.reshape(-1, 3)), Topology.from_faces(faces)


def plain_formula(topology: Topology) -> Energy:
    """E as one would write it: gather, cross, normalise, norm, sum."""
    triangles, faces = topology.triangles, topology.interior_edge_faces
    edges = topology.interior_edges

    def energy(vertices: Tensor) -> Tensor:
        corners = vertices[triangles]
        normals = torch.linalg.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = torch.nn.functional.normalize(normals, dim=-1)
        lengths = torch.linalg.vector_norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], dim=-1)
        duals = torch.linalg.vector_norm(normals[faces[:, 0]] - normals[faces[:, 1]], dim=-1)
        total: Tensor = (lengths * duals).sum()
        return total

    return energy


def normal_consistency(topology: Topology) -> Energy:
    """Mean of 1 - cos of the angles between neighbouring normals, from the four vertices of every edge."""
    flaps = topology.edge_flaps

    def energy(vertices: Tensor) -> Tensor:
        v, w, a, b = (vertices[flaps[:, k]] for k in range(4))
        left = torch.linalg.cross(w - v, a - v)
        right = -torch.linalg.cross(w - v, b - v)
        mean: Tensor = (1 - torch.cosine_similarity(left, right, dim=-1)).mean()
        return mean

    return energy


def without_numba(topology: Topology) -> Energy:
    """E by torch operations, whatever is installed."""

    def energy(vertices: Tensor) -> Tensor:
        fewest, compiled.FEWEST_FACES = compiled.FEWEST_FACES, sys.maxsize
        try:
            return normal_variation(vertices, topology)
        finally:
            compiled.FEWEST_FACES = fewest

    return energy


def run(energy: Energy, vertices: Tensor, clock: Clock = time.perf_counter) -> tuple[float, float, Tensor]:
    """Seconds of forward and backward, value and gradient."""
    variable = vertices.clone().requires_grad_()
    start = clock()
    value = energy(variable)
    value.backward()
    seconds = clock() - start
    assert variable.grad is not None
    return seconds, value.item(), variable.grad


def measure(vertex_count: int, dtype: torch.dtype, repeats: int, clock: Clock) -> dict[str, Any]:
    vertices, topology = shaken_torus(vertex_count)
    vertices = vertices.to(dtype)
    energies: dict[str, Energy] = {
        "torchfair": lambda v: normal_variation(v, topology),
        "plain": plain_formula(topology),
        "normal consistency": normal_consistency(topology),
    }
    if compiled.compiled_serves(vertices, None, topology):
        energies["without numba"] = without_numba(topology)
    _, value, gradient = run(energies["torchfair"], vertices)
    _, expected, expected_gradient = run(energies["plain"], vertices)
    difference = (gradient - expected_gradient).abs().max().item() / expected_gradient.abs().max().item()
    for _ in range(2):
        for energy in energies.values():
            run(energy, vertices)
    times: dict[str, list[float]] = {name: [] for name in energies}
    for _ in range(repeats):
        for name, energy in energies.items():
            times[name].append(1e3 * run(energy, vertices, clock)[0])
    rows = {}
    for name, own in times.items():
        ratios = [other / mine for other, mine in zip(own, times["torchfair"], strict=True)]
        rows[name] = {
            "milliseconds_min": min(own),
            "milliseconds_median": statistics.median(own),
            "times_torchfair_min": min(own) / min(times["torchfair"]),
            "times_torchfair_median": statistics.median(ratios),
        }
    return {
        "vertices": topology.num_vertices,
        "faces": topology.num_faces,
        "dtype": str(dtype).removeprefix("torch."),
        "repeats": repeats,
        "relative_difference_of_values": abs(value - expected) / expected,
        "relative_difference_of_gradients": difference,
        "rows": rows,
    }


def report(result: dict[str, Any], threads: int) -> str:
    lines = [
        f"{result['vertices']} vertices, {result['dtype']}, {threads} thread(s), {result['repeats']} repeats",
        f"  relative difference from plain: {result['relative_difference_of_values']:.0e} in value,"
        f" {result['relative_difference_of_gradients']:.0e} in gradient",
        f"  {'forward + backward':20s} {'min ms':>9s} {'median ms':>10s} {'min ratio':>10s} {'median ratio':>13s}",
    ]
    rows = result["rows"]
    assert isinstance(rows, dict)
    for name, row in rows.items():
        lines.append(
            f"  {name:20s} {row['milliseconds_min']:9.1f} {row['milliseconds_median']:10.1f}"
            f" {row['times_torchfair_min']:10.2f} {row['times_torchfair_median']:13.2f}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, nargs="+", default=[50_000, 200_000])
    parser.add_argument("--threads", type=int, nargs="+", default=[2], help="thread counts to measure with, in turn")
    parser.add_argument("--dtype", choices=["float64", "float32"], default="float64")
    parser.add_argument("--clock", choices=["wall", "processor"], default="wall")
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--json", type=Path, help="file to write the results to")
    arguments = parser.parse_args()
    clock = time.process_time if arguments.clock == "processor" else time.perf_counter
    results = []
    for threads in arguments.threads:
        torch.set_num_threads(threads)
        for count in arguments.vertices:
            measured = measure(count, getattr(torch, arguments.dtype), arguments.repeats, clock)
            result = {"threads": threads, "clock": arguments.clock, **measured}
            print(report(result, threads), flush=True)
            results.append(result)
    if arguments.json:
        machine = {"cores": os.cpu_count(), "processor": platform.processor() or platform.machine()}
        document = {"benchmark": "normal_variation", "torch": torch.__version__, "machine": machine, "results": results}
        arguments.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
