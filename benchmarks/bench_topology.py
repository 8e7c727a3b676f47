"""Time to build, read, write and repair a mesh of a million triangles.

Run ``python benchmarks/bench_topology.py [--triangles 1000000] [--repeat 3] [--json FILE]``. Prints a table
of wall-clock and processor seconds, each the best of the repetitions; processor time tells how busy the
machine was otherwise. The vertices and faces are numbered at random, so memory is used as by a mesh from
elsewhere, not as by a tidy grid.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

import torchfair
from torchfair import Topology
from torchfair.energies import normal_variation
from torchfair.io import load_mesh, save_mesh
from torchfair.polylines import mesh_polylines, straight_triples
from torchfair.repair import repair_mesh

TARGET = 10.0  # seconds allowed for a topology of a million triangles


def shuffled_grid(num_triangles: int, seed: int = 0) -> tuple[torch.Tensor, np.ndarray]:
    """Vertices and triangles of a bumpy grid in random order."""
    rng = np.random.default_rng(seed)
    side = round((num_triangles / 2) ** 0.5) + 1
    index = rng.permutation(side * side).reshape(side, side)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return torch.from_numpy(rng.normal(size=(side * side, 3))), faces[rng.permutation(len(faces))]


def best_times(job: Callable[[], object], repeat: int) -> dict[str, float]:
    wall, processor = [], []
    for _ in range(repeat):
        begin = time.perf_counter(), time.process_time()
        job()
        wall.append(time.perf_counter() - begin[0])
        processor.append(time.process_time() - begin[1])
    return {"wall_s": min(wall), "processor_s": min(processor)}


def jobs(vertices: torch.Tensor, faces: np.ndarray, folder: Path) -> dict[str, Callable[[], object]]:
    topology = Topology.from_faces(faces)
    turned = np.random.default_rng(1).random(len(faces)) < 0.3
    damaged = np.where(turned[:, None], faces[:, ::-1], faces)
    named: dict[str, Callable[[], object]] = {
        "Topology.from_faces": lambda: Topology.from_faces(faces),
        "  manifold edges only": lambda: Topology.from_faces(faces, manifold="edges"),
        "  and E on it, once": lambda: normal_variation(vertices, Topology.from_faces(faces, manifold="edges")),
        "E on a kept topology": lambda: normal_variation(vertices, topology),
    }
    for label, name, binary in (("OBJ", "m.obj", False), ("PLY text", "t.ply", False), ("PLY binary", "b.ply", True)):
        path = folder / name

        def write(path: Path = path, binary: bool = binary) -> None:
            save_mesh(path, vertices, topology, overwrite=True, binary=binary)

        def read(path: Path = path) -> None:
            load_mesh(path)

        named[f"save_mesh {label}"] = write
        named[f"load_mesh {label}"] = read
    named["repair_mesh, 30 % turned over"] = lambda: repair_mesh(vertices, damaged)
    named["straight_triples"] = lambda: straight_triples(topology)
    named["mesh_polylines"] = lambda: mesh_polylines(topology)
    return named


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--triangles", type=int, default=1_000_000, help="size of the mesh")
    parser.add_argument("--repeat", type=int, default=3, help="repetitions; the best one counts")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()

    vertices, faces = shuffled_grid(options.triangles)
    print(f"{len(faces)} triangles, {len(vertices)} vertices, best of {options.repeat}")
    print(f"{'':32}{'wall s':>8}{'cpu s':>8}")
    times = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, job in jobs(vertices, faces, Path(folder)).items():
            times[name] = best_times(job, options.repeat)
            print(f"{name:32}{times[name]['wall_s']:8.2f}{times[name]['processor_s']:8.2f}", flush=True)
    met = times["Topology.from_faces"]["wall_s"] * 1e6 / len(faces) < TARGET
    print(f"target: Topology of a million triangles in under {TARGET:.0f} s: {'met' if met else 'MISSED'}")
    if options.json:
        versions = {"torchfair": torchfair.__version__, "torch": torch.__version__, "numpy": np.__version__}
        machine = {"python": platform.python_version(), "processors": os.cpu_count(), **versions}
        report = {"triangles": len(faces), "times": times, "target_met": met, "machine": machine}
        options.json.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
