r"""A surface whose connectivity changes at every step: a neural signed distance field, regularised by E.

A small network with random Fourier features learns the signed distance to a torus from noisy samples of it. At every
step its zero surface is extracted by marching tetrahedra, a mesh of other faces each time, and regularised::

    loss = mean (network - sampled distance)^2 + weight * E / C of the torus

The same without regulariser, and with a Laplacian loss (mean squared umbrella vectors, in cells) are the comparison.
The state with the smallest error on other noisy samples is kept; what counts is the distance of the vertices from the
torus, and E over its C, of which the exact distances have 1.4 on such a mesh of slivers.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass

import torch
from _common import Report, Results, run_experiment, setting
from _marching import lattice, zero_surface
from _training import Training, TrainingConfig, train, training_files
from torch import Tensor, nn

from torchfair import Topology
from torchfair.energies import normal_variation, umbrella_fairness
from torchfair.shapes import Torus
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet
from torchfair.viewing.wireframe import outline

NAME = "train_signed_distance"
ENERGY, PLAIN, LAPLACIAN = "normal_variation", "plain", "laplacian"
RUNS = (PLAIN, ENERGY, LAPLACIAN)
WORDS = {PLAIN: "no regulariser", ENERGY: "$E$", LAPLACIAN: "Laplacian"}
PICTURE = "surfaces.png"
HALF_WIDTH, LARGE, SMALL = 1.0, 0.62, 0.27

Mesh = tuple[Tensor, Topology]


@dataclass(frozen=True)
class Config(TrainingConfig):
    """Settings of the experiment."""

    steps: int = setting(200, "optimiser steps", least=1)
    learning_rate: float = setting(0.003, "of Adam at the start; falls to 0 like half a cosine wave", least=0)
    log_every: int = setting(20, "steps between log lines, validations and checkpoints", least=1)
    dtype: str = setting("float32", "precision", choices=("float32", "float64"))
    nodes: int = setting(22, "nodes of the lattice along an edge of the cube, of length 2", least=6)
    features: int = setting(48, "random directions of Fourier features", least=1)
    frequency: float = setting(3.0, "standard deviation of their components", least=0)
    samples: int = setting(1500, "noisy distances to train on", least=1)
    validation_samples: int = setting(1000, "noisy distances to choose the best state by", least=1)
    noise: float = setting(0.06, "standard deviation of the noise", least=0)
    batch: int = setting(500, "samples per step", least=1)
    warm_up: int = setting(30, "steps without regulariser", least=0)
    weight: float = setting(1e-3, "of E over C", least=0)
    laplacian_weight: float = setting(0.003, "of the Laplacian loss", least=0)
    runs: tuple[str, ...] = setting(RUNS, "regularisers to compare", choices=RUNS)


def torus_distance(points: Tensor) -> Tensor:
    """Signed distance (N,) to the torus, negative inside."""
    from_circle = torch.linalg.vector_norm(points[:, :2], dim=1) - LARGE
    return torch.hypot(from_circle, points[:, 2]) - SMALL


class DistanceField(nn.Module):
    """A network of points (N, 3) to signed distances (N,).

    Args:
        directions: (3, n) of the Fourier features.
    """

    directions: Tensor

    def __init__(self, directions: Tensor) -> None:
        super().__init__()
        self.register_buffer("directions", directions)
        width = 3 + 2 * directions.shape[1]
        self.layers = nn.Sequential(
            nn.Linear(width, 64), nn.SiLU(), nn.Linear(64, 64), nn.SiLU(), nn.Linear(64, 1)
        )  # fmt: skip

    def forward(self, points: Tensor) -> Tensor:
        """Distances (N,)."""
        phases = points @ self.directions
        found: Tensor = self.layers(torch.cat([points, phases.sin(), phases.cos()], dim=1))
        return found[:, 0]


def regulariser(run: str, config: Config, smooth: float) -> Callable[[Tensor, Topology], Tensor]:
    """Weighted loss of a mesh (vertices, topology)."""
    cell = 2 * HALF_WIDTH / (config.nodes - 1)
    if run == ENERGY:
        return lambda vertices, topology: config.weight * normal_variation(vertices, topology) / smooth
    return lambda vertices, topology: (
        config.laplacian_weight * umbrella_fairness(vertices, topology) / (max(topology.num_vertices, 1) * cell**2)
    )


def fit(config: Config, results: Results, run: str) -> tuple[Mesh, Training]:
    """The surface of the best state, and how the training went."""
    random = torch.Generator().manual_seed(config.seed)

    def draw(count: int) -> tuple[Tensor, Tensor]:
        points = HALF_WIDTH * (2 * torch.rand(count, 3, generator=random, dtype=torch.float64) - 1)
        noise = config.noise * torch.randn(count, generator=random, dtype=torch.float64)
        return points.to(**config.place), (torus_distance(points) + noise).to(**config.place)

    points, distances = draw(config.samples)
    others, other_distances = draw(config.validation_samples)
    directions = config.frequency * torch.randn(3, config.features, generator=random)
    torch.manual_seed(config.seed)  # of the weights
    model = DistanceField(directions).to(**config.place)
    nodes, smooth = lattice(config.nodes, HALF_WIDTH), torus().total_absolute_curvature()
    places, penalty = nodes.to(**config.place), regulariser(run, config, smooth)
    generator = torch.Generator(config.device).manual_seed(config.seed)
    done = 0

    def surface() -> Mesh:
        return zero_surface(model(places), places, config.nodes)

    def terms() -> dict[str, Tensor]:
        nonlocal done
        done += 1
        batch = torch.randint(config.samples, (config.batch,), generator=generator, device=config.device)
        data = (model(points[batch]) - distances[batch]).square().mean()
        if run == PLAIN or done <= config.warm_up:
            return {"loss": data, "data": data}
        term = penalty(*surface())
        return {"loss": data + term, "data": data, "regulariser": term}

    def validate() -> dict[str, float]:
        vertices, topology = surface()
        return {
            "validation": _root_mean_square(model(others) - other_distances),
            "error": _root_mean_square(torus_distance(vertices)),
            "normal_variation_over_c": float(normal_variation(vertices, topology)) / smooth,
        }

    training = train(model, terms, validate, name=run, config=config, results=results, generator=generator)
    with torch.no_grad():
        vertices, topology = surface()
    return (vertices.cpu().double(), topology.cpu()), training


def _root_mean_square(values: Tensor) -> float:
    return math.sqrt(float(values.square().mean())) if values.numel() else math.nan


def torus() -> Torus:
    """The surface that is sampled."""
    return Torus(LARGE, SMALL)


def draw_surfaces(meshes: dict[str, Mesh], width: int, results: Results) -> None:
    """The meshes in daylight, side by side."""
    exact, faces = meshes["the torus"]
    towards_eye, up = view_direction(exact, faces)
    panel = (width - 2 * MARGIN - (len(meshes) - 1) * GAP) // len(meshes)
    points = [vertices for vertices, _ in meshes.values() if len(vertices)]
    camera, size = fit_camera(torch.cat(points), towards_eye=towards_eye, up=up, width=panel)
    sheet = Sheet(width, CAPTION + size[0] + 2 * MARGIN)
    for column, (name, (vertices, topology)) in enumerate(meshes.items()):
        left = MARGIN + column * (panel + GAP)
        ratio = float(normal_variation(vertices, topology)) / torus().total_absolute_curvature()
        sheet.caption(f"{name}:  $E/C$ = {ratio:.2f}", left, 0, panel)
        mesh = MeshView(vertices, topology, camera, size)
        sheet.image(mesh.paint(shade_faces(vertices, topology, camera), edges=outline(mesh)), left, CAPTION)
    sheet.write(results.path(PICTURE), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Trains with each regulariser, draws, and prints what came out."""
    nodes = lattice(config.nodes, HALF_WIDTH)
    exact = zero_surface(torus_distance(nodes), nodes, config.nodes)
    smooth = torus().total_absolute_curvature()
    report: Report = {
        "total_absolute_curvature": smooth,
        "exact_normal_variation_over_c": float(normal_variation(*exact)) / smooth,
        "interrupted": False,
    }
    meshes = {"the torus": exact}
    for run in config.runs:
        if report["interrupted"]:
            break
        mesh, training = fit(config, results, run)
        meshes[WORDS[run]] = mesh
        report[run] = {"best": training.best, "seconds": training.seconds, "records": training.records}
        report["interrupted"] = training.interrupted
        results.mesh(f"{run}.obj", *mesh)
        if training.records:
            best = training.best
            print(
                f"{WORDS[run]}: distance from the torus {best['error']:.4f}, "
                f"E/C {best['normal_variation_over_c']:.3f}, validation {best['validation']:.4f}, "
                f"best at step {best['step']:.0f}"
            )
    draw_surfaces(meshes, config.width, results)
    return report


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [PICTURE, *(f"{run}.obj" for run in RUNS)]
    trained = [file for run in RUNS for file in training_files(run)]
    return run_experiment(NAME, __doc__, Config, experiment, [*files, *trained], arguments)


if __name__ == "__main__":
    sys.exit(main())
