r"""Training with E as regulariser: a mesh is fitted to noisy samples of a saddle.

The model is a height field over a triangle lattice, one parameter per vertex. The data term is the mean squared
distance in height between the mesh and noisy samples, drawn in random batches; the regulariser is E per unit of
area, :class:`torchfair.energies.NormalVariation`::

    loss = mean (height of the mesh - sampled height)^2 + weight * E / area

The state with the smallest error on other noisy samples is kept. The same training without regulariser is the
comparison; what counts is the error against the saddle itself, and E against C of the saddle.

This is the pattern of all training scripts here: settings are a frozen dataclass and become options of the command
line, ``train`` logs and keeps checkpoints, and Ctrl-C keeps the best state, from which pictures and meshes are made.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _charts import BLUE, DASHES, GREY, ORANGE, add_chart, add_legend
from _common import Report, Results, run_experiment, setting
from _training import Record, Training, TrainingConfig, train, training_files
from torch import Tensor, nn

from torchfair import Topology
from torchfair.energies import NormalVariation
from torchfair.reflection import Stripes, face_mirror_directions
from torchfair.shapes import Paraboloid, parameter_triangles
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.shading import shade_faces, stripe_colors, stripe_frequency
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet
from torchfair.viewing.wireframe import outline, quiet_edges

NAME = "train_height_field"
RUNS = ("regularised", "plain")
PICTURE, CHART = "surfaces.png", "losses.png"
MESHES = tuple(f"{run}.obj" for run in RUNS)


@dataclass(frozen=True)
class Config(TrainingConfig):
    """Settings of the experiment."""

    rows: int = setting(24, "rows of the lattice", least=2)
    columns: int = setting(24, "columns of the lattice", least=2)
    a: float = setting(1.0, "curvature of the saddle along x")
    b: float = setting(-0.7, "curvature of the saddle along y")
    points: int = setting(900, "noisy samples to train on", least=1)
    validation_points: int = setting(600, "noisy samples to choose the best state by", least=1)
    noise: float = setting(0.05, "standard deviation of the noise; the saddle spans 2 x 2", least=0)
    batch: int = setting(450, "samples per step", least=1)
    weight: float = setting(5e-4, "of E per area in the loss", least=0)
    compare: bool = setting(True, "train without regulariser as well")


# ---- data and model ------------------------------------------------------------------------------------


class Samples(nn.Module):
    """Points in the plane with noisy heights, and where they lie in a triangle mesh over the plane.

    Args:
        plan: (V, 2) vertices of the mesh in the plane.
        triangles: (F, 3).
        places: (N, 2) in the plane, inside the mesh.
        heights: (N,) measured there.
    """

    corners: Tensor
    shares: Tensor
    heights: Tensor

    def __init__(self, plan: Tensor, triangles: Tensor, places: Tensor, heights: Tensor) -> None:
        super().__init__()
        corners = plan[triangles]
        edges = torch.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], dim=-1)
        offsets = places[:, None] - corners[:, 0]
        second_third = torch.linalg.solve(edges, offsets[..., None]).squeeze(-1)  # (N, F, 2)
        shares = torch.cat([1 - second_third.sum(-1, keepdim=True), second_third], dim=-1)
        chosen = shares.amin(-1).argmax(-1)
        self.register_buffer("corners", triangles[chosen])
        self.register_buffer("shares", shares[torch.arange(len(places)), chosen])
        self.register_buffer("heights", heights)

    def residuals(self, mesh_heights: Tensor, batch: Tensor | None = None) -> Tensor:
        """Height of the mesh above the sampled one, (N,) or for the samples in ``batch``."""
        corners, shares, heights = self.corners, self.shares, self.heights
        if batch is not None:
            corners, shares, heights = corners[batch], shares[batch], heights[batch]
        return (mesh_heights[corners] * shares).sum(-1) - heights


class HeightField(nn.Module):
    """A mesh over fixed places in the plane; its heights are the parameters.

    Args:
        plan: (V, 2).
    """

    plan: Tensor

    def __init__(self, plan: Tensor) -> None:
        super().__init__()
        self.register_buffer("plan", plan)
        self.heights = nn.Parameter(plan.new_zeros(len(plan)))

    def forward(self) -> Tensor:
        """Vertices (V, 3)."""
        return torch.cat([self.plan, self.heights[:, None]], dim=1)


@dataclass(frozen=True)
class Problem:
    """Everything that does not change in a training.

    Attributes:
        exact: (V, 3) vertices on the saddle.
        topology: of the mesh.
        training, validation, truth: samples; those of ``truth`` have no noise.
        smooth: C of the saddle, the E that a principal mesh would have.
    """

    exact: Tensor
    topology: Topology
    training: Samples
    validation: Samples
    truth: Samples
    smooth: float


def make_problem(config: Config) -> Problem:
    """The saddle, its lattice, and samples drawn from ``config.seed``."""
    saddle = Paraboloid(config.a, config.b)
    mesh = parameter_triangles(saddle, config.rows, config.columns)
    random = torch.Generator().manual_seed(config.seed)

    def draw(count: int, noise: float) -> Samples:
        places = 2 * torch.rand(count, 2, generator=random, dtype=torch.float64) - 1
        heights = saddle.position(*places.unbind(1))[:, 2]
        heights = heights + noise * torch.randn(count, generator=random, dtype=torch.float64)
        samples = Samples(mesh.vertices[:, :2], mesh.topology.triangles, places, heights)
        return samples.to(**config.place)

    return Problem(
        exact=mesh.vertices.to(**config.place),
        topology=mesh.topology.to(config.device),
        training=draw(config.points, config.noise),
        validation=draw(config.validation_points, config.noise),
        truth=draw(2000, 0.0),
        smooth=saddle.total_absolute_curvature(),
    )


# ---- training ------------------------------------------------------------------------------------------


def fit(problem: Problem, config: Config, results: Results, run: str) -> tuple[Tensor, Training]:
    """Vertices (V, 3) of the best state, and how the training went."""
    model = HeightField(problem.exact[:, :2])
    energy = NormalVariation(problem.topology)
    weight = config.weight if run == "regularised" else 0.0
    generator = torch.Generator(config.device).manual_seed(config.seed)

    def terms() -> dict[str, Tensor]:
        batch = torch.randint(config.points, (config.batch,), generator=generator, device=config.device)
        data = problem.training.residuals(model.heights, batch).square().mean()
        variation = energy(model())
        return {"loss": data + weight * variation / 4.0, "data": data, "normal_variation": variation}

    def validate() -> dict[str, float]:
        return {
            "validation": _root_mean_square(problem.validation, model),
            "error": _root_mean_square(problem.truth, model),
        }

    training = train(model, terms, validate, name=run, config=config, results=results, generator=generator)
    return model().detach(), training


def _root_mean_square(samples: Samples, model: HeightField) -> float:
    return math.sqrt(float(samples.residuals(model.heights).square().mean()))


def summary(vertices: Tensor, training: Training, problem: Problem) -> Report:
    """What the best state is like."""
    energy = float(NormalVariation(problem.topology)(vertices))
    return {
        "normal_variation": energy,
        "normal_variation_over_c": energy / problem.smooth,
        "best": training.best,
        "last": training.records[-1] if training.records else None,
        "seconds": training.seconds,
        "interrupted": training.interrupted,
        "stopped_early": training.stopped_early,
    }


# ---- pictures ------------------------------------------------------------------------------------------


def draw_surfaces(meshes: dict[str, Tensor], problem: Problem, width: int, results: Results) -> None:
    """The meshes in daylight (above) and as mirrors (below)."""
    topology, energy = problem.topology.to("cpu"), NormalVariation(problem.topology.to("cpu"))
    meshes = {name: vertices.to("cpu", torch.float64) for name, vertices in meshes.items()}
    exact = meshes["the saddle"]
    towards_eye, up = view_direction(exact, topology)
    panel = (width - 2 * MARGIN - (len(meshes) - 1) * GAP) // len(meshes)
    camera, size = fit_camera(*meshes.values(), towards_eye=towards_eye, up=up, width=panel)
    across = camera.axes[0, 0]
    frequency = stripe_frequency(face_mirror_directions(exact, topology, camera)[0] @ across, topology)
    stripes = Stripes(across, frequency)
    sheet = Sheet(width, CAPTION + 2 * size[0] + 2 * MARGIN)
    for column, (name, vertices) in enumerate(meshes.items()):
        left = MARGIN + column * (panel + GAP)
        sheet.caption(f"{name}:  $E$ = {float(energy(vertices)):.3g}", left, 0, panel)
        mesh = MeshView(vertices, topology, camera, size)
        sheet.image(mesh.paint(shade_faces(vertices, topology, camera), edges=quiet_edges(mesh)), left, CAPTION)
        values = stripes(face_mirror_directions(vertices, topology, camera)[0])[:, 0]
        mirror = mesh.paint(stripe_colors(values), edges=outline(mesh))
        sheet.image(mirror, left, CAPTION + size[0] + MARGIN)
    sheet.write(results.path(PICTURE), overwrite=results.force)


def draw_losses(trainings: dict[str, Training], problem: Problem, results: Results) -> None:
    """Errors and E over the steps; the best states are marked."""
    sheet = Sheet(1600, 620)
    titles = {"error": "root mean square error against the saddle", "normal_variation": "$E$ over $C$ of the saddle"}
    for column, (key, title) in enumerate(titles.items()):
        axes = add_chart(sheet, 110 + 780 * column, 70, 660, 450, title=title, x="step")
        unit = problem.smooth if column else 1.0
        for (name, training), color in zip(trainings.items(), (BLUE, ORANGE), strict=False):
            values = [value / unit for value in _column(training.records, key)]
            words = "with $E$" if name == "regularised" else "without $E$"
            axes.plot(_column(training.records, "step"), values, color=color, linewidth=2, label=words)
            if training.records:
                axes.plot(training.best["step"], training.best[key] / unit, "o", color=color, markersize=7)
        if column:
            exact = float(NormalVariation(problem.topology)(problem.exact)) / unit
            axes.axhline(exact, color=GREY, linewidth=1.2, linestyle=DASHES, label="the saddle on this lattice")
            axes.set_yscale("log")
            axes.set_yticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
            axes.minorticks_off()
            add_legend(axes, loc="center right")
        else:
            axes.set_ylim(bottom=0)
    sheet.write(results.path(CHART), overwrite=results.force)


def _column(records: list[Record], key: str) -> list[float]:
    return [record[key] for record in records]


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Trains with and without regulariser, draws, and prints what came out."""
    problem = make_problem(config)
    trainings: dict[str, Training] = {}
    report: Report = {"total_absolute_curvature": problem.smooth, "interrupted": False}
    meshes = {"the saddle": problem.exact}
    for run in RUNS if config.compare else RUNS[:1]:
        if report["interrupted"]:
            break
        vertices, training = fit(problem, config, results, run)
        trainings[run] = training
        report[run] = summary(vertices, training, problem)
        report["interrupted"] = training.interrupted
        meshes["with $E$" if run == "regularised" else "without $E$"] = vertices
        results.mesh(f"{run}.obj", vertices, problem.topology.to("cpu"))
    for run, training in trainings.items():
        if training.records:
            print(
                f"{run}: error against the saddle {training.best['error']:.4f}, validation "
                f"{training.best['validation']:.4f}, E/C {report[run]['normal_variation_over_c']:.3f}, best at step "
                f"{training.best['step']:.0f} of {config.steps}"
            )
    draw_surfaces(meshes, problem, config.width, results)
    draw_losses(trainings, problem, results)
    return report


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [PICTURE, CHART, *MESHES, *(file for run in RUNS for file in training_files(run))]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
