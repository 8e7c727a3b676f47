"""Closest points on reference surfaces: construction, one search, and following points that move.

Run ``python benchmarks/bench_closest_point.py [--json FILE]``. Times are the best of several runs in
milliseconds, on one thread. The last column is the nearest *vertex* by SciPy's k-d tree, which is no distance
to the surface: it stands for the cost of looking up something near.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from torchfair import Topology
from torchfair.geometry.closest_point import ReferenceSurface


def torus(rows: int, columns: int, *, triangles: bool, grading: float = 0.0) -> tuple[Tensor, Topology]:
    """Torus of radii 3 and 1; ``grading`` crowds the parameter lines, which makes long faces."""
    u, v = np.meshgrid(np.arange(rows) / rows, np.arange(columns) / columns, indexing="ij")
    u, v = (2 * np.pi * x + grading * np.sin(2 * np.pi * x) for x in (u, v))
    ring = 3 + np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    a = np.arange(rows * columns).reshape(rows, columns)
    b, d = np.roll(a, -1, 0), np.roll(a, -1, 1)
    quads = np.stack([a, b, np.roll(b, -1, 1), d], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if triangles else quads
    return torch.from_numpy(points), Topology.from_faces(faces)


def best(function: Callable[[], object], repeats: int) -> float:
    """Shortest wall time of ``function`` in milliseconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def measure(vertices: Tensor, topology: Topology, count: int, repeats: int) -> dict[str, float]:
    """Times of one surface with ``count`` points at about 5 % of an edge length from it."""
    generator = np.random.default_rng(0)
    surface = ReferenceSurface(vertices, topology)
    corners = surface.points[surface.pieces].numpy()
    edge = float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).mean())
    rows = generator.integers(0, len(corners), count)
    spots = np.einsum("nk,nkd->nd", generator.dirichlet([1, 1, 1], count), corners[rows])
    points = torch.from_numpy(spots + 0.05 * edge * generator.normal(size=spots.shape))
    result = {
        "pieces": len(corners),
        "points": count,
        "construction": best(lambda: ReferenceSurface(vertices, topology), 3),
        "search": best(lambda: surface.closest(points), repeats),
        "gathering": best(lambda: gather_candidates(surface, points), repeats),
    }
    for share in (0.001, 0.02, 0.1):
        moved = points + torch.from_numpy(share * edge * generator.normal(size=spots.shape) / 3**0.5)
        tracker = surface.tracker()
        tracker.closest(points)
        tracker.closest(points)  # at rest: candidates are gathered
        result[f"moved {share:g} edges"] = best(partial(tracker.closest, moved), repeats)
    tree = cKDTree(vertices.numpy())
    result["nearest vertex"] = best(lambda: tree.query(points.numpy()), repeats)
    return result


def gather_candidates(surface: ReferenceSurface, points: Tensor) -> None:
    """The first two calls of a tracker: a search, then a search that keeps candidates."""
    tracker = surface.tracker()
    tracker.closest(points)
    tracker.closest(points)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the results to this file")
    parser.add_argument("--repeats", type=int, default=15, help="runs per figure (default: %(default)s)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    shapes = {
        "triangles": (*torus(66, 33, triangles=True), 2500),
        "quads": (*torus(46, 23, triangles=False), 2500),
        "graded quads": (*torus(46, 23, triangles=False, grading=0.9), 2500),
        "fine triangles": (*torus(320, 160, triangles=True), 50_000),
    }
    results = {name: measure(*shape, arguments.repeats) for name, shape in shapes.items()}
    columns = next(iter(results.values()))
    print(" ".join([f"{'':>15}", *(f"{column:>17}" for column in columns)]))
    for name, row in results.items():
        print(" ".join([f"{name:>15}", *(f"{value:>17.5g}" for value in row.values())]))
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
