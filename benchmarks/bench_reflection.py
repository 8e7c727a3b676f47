"""Rendered reflections: pictures and their gradients at several sizes, against ray casting by trimesh with embreex.

Run ``python benchmarks/bench_reflection.py [--json FILE]``. A torus of 10 000 faces, single precision, one view, on one
thread; processor times in milliseconds, the best of several runs taken in turns. Rays are cast for the same pixels if
``embreex`` is installed: they find the faces that are seen and colour nothing.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import time
from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.reflection import Camera, OrthographicCamera, PerspectiveCamera, Stripes, render_reflection
from torchfair.shapes import Torus, irregular_triangles

DIRECTION = torch.tensor([1.0, 0.5, -1.0])
STRIPES = Stripes(torch.tensor([1.0, 0.3, 0.2]))


def timed(function: Callable[[], object]) -> float:
    """Processor time in milliseconds."""
    start = time.process_time()
    function()
    return 1e3 * (time.process_time() - start)


def forward_and_backward(vertices: Tensor, topology: Topology, camera: Camera, size: int) -> None:
    moved = vertices.clone().requires_grad_()
    render_reflection(moved, topology, camera, STRIPES, size=size).image.square().sum().backward()


def ray_caster(vertices: Tensor, topology: Topology, camera: Camera, size: int) -> Callable[[], object] | None:
    """Finds the first face on the ray of every pixel; None without embreex."""
    if importlib.util.find_spec("embreex") is None:
        return None
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    mesh = trimesh.Trimesh(vertices.numpy(), topology.triangles.numpy(), process=False)
    origins, directions = (part.reshape(-1, 3) for part in camera.rays(size))
    if camera.near is None:
        origins = origins - 10 * directions
    rays = RayMeshIntersector(mesh)
    return lambda: rays.intersects_first(origins.numpy(), directions.numpy())


def measure(vertices: Tensor, topology: Topology, camera: Camera, size: int, repeats: int) -> dict[str, float]:
    """Best times of the tasks."""
    tasks: dict[str, Callable[[], object]] = {
        "picture": lambda: render_reflection(vertices, topology, camera, STRIPES, size=size),
        "antialiased": lambda: render_reflection(vertices, topology, camera, STRIPES, size=size, antialias=True),
        "forward + backward": lambda: forward_and_backward(vertices, topology, camera, size),
    }
    caster = ray_caster(vertices, topology, camera, size)
    if caster is not None:
        tasks["rays"] = caster
    times: dict[str, float] = dict.fromkeys(tasks, float("inf"))
    for _ in range(repeats + 1):
        for name, task in tasks.items():
            times[name] = min(times[name], timed(task))
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="write the numbers to this file too")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    mesh = irregular_triangles(Torus(), 5000)
    vertices, topology = mesh.vertices.float(), mesh.topology
    cameras: dict[str, Camera] = {
        "parallel": OrthographicCamera.fit(vertices, directions=DIRECTION),
        "perspective": PerspectiveCamera.fit(vertices, directions=DIRECTION),
    }
    rows = []
    print(
        f"{'':>11} {'size':>5} {'picture':>8} {'antialiased':>12} {'fwd + bwd':>10} {'rays':>8} {'picture / rays':>15}"
    )
    for name, camera in cameras.items():
        for size in (256, 512, 1024):
            times = measure(vertices, topology, camera, size, arguments.repeats)
            rays = times.get("rays", float("nan"))
            ratio = times["picture"] / rays
            rows.append({"camera": name, "size": size, "faces": topology.num_faces, **times, "picture / rays": ratio})
            print(
                f"{name:>11} {size:5d} {times['picture']:8.1f} {times['antialiased']:12.1f} "
                f"{times['forward + backward']:10.1f} {rays:8.1f} {ratio:15.2f}"
            )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
