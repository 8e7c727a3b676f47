"""Vertices slide on a saddle surface until its reflections are smooth.

An irregular triangle mesh; inner vertices glide on the surface through their two parameters, the boundary is fixed.
Three losses by the same number of steps of Adam: the reflection loss (1 - SSIM over six views and four stripe
directions, and a share of the reflection variation), its first part alone, and the energy E alone, each with a penalty
on corner angles below 20 degrees. All are judged by the reflection score in the same views and in six others, by E, and
by flipped faces.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import torch
from _charts import BLUE, GREEN, ORANGE, add_chart, add_legend
from _common import Report, Results, run_experiment, setting
from _layouts import IRREGULAR, SADDLES, layout
from _mirrors import Mirror, mirror_picture, panel_width, panels, smooth_mirror, striped
from _training import Training, TrainingConfig, train, training_files
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation
from torchfair.geometry import angles, face_normals
from torchfair.reflection import (
    OrthographicCamera,
    ReflectionLoss,
    ReflectionSetup,
    SmoothReference,
    cone_directions,
    reflection_score,
)
from torchfair.shapes import ShapeMesh
from torchfair.viewing import fit_camera
from torchfair.viewing.sheet import Sheet

NAME = "optimise_reflection"
PICTURE, CHART = "reflections.png", "history.png"
START, BOTH, SCORE, ENERGY = "start", "1 - SSIM and variation", "1 - SSIM alone", "E alone"
LOSSES = (BOTH, SCORE, ENERGY)
COLORS = {BOTH: BLUE, SCORE: ORANGE, ENERGY: GREEN}
MESHES = ("start.obj", "reflection.obj", "score_alone.obj", "energy_alone.obj")


@dataclass(frozen=True)
class Config(TrainingConfig):
    """Settings of the experiment."""

    surfaces: tuple[str, ...] = setting(
        ("torus", "paraboloid", "catenoid"), "surfaces; the first is drawn", choices=tuple(SADDLES)
    )
    rows: int = setting(16, "square root of the number of vertices, about", least=6)
    steps: int = setting(100, "steps of every optimisation", least=1)
    learning_rate: float = setting(0.02, "of Adam, in edge lengths; the same for all steps", least=1e-6)
    log_every: int = setting(10, "steps between measurements and checkpoints", least=1)
    dtype: str = setting("float64", "precision", choices=("float64",))
    weight: float = setting(0.1, "weight of the variation", least=0)
    shape: float = setting(10.0, "weight of the penalty on small angles, 0 for none", least=0)
    smallest_angle: float = setting(20.0, "angles in degrees below which it acts", least=0.1)
    size: int = setting(128, "pixels along a picture while optimising", least=32)
    judged_size: int = setting(256, "pixels along the pictures by which meshes are judged", least=32)

    def rate(self, step: int) -> float:
        """Learning rate of a step."""
        return self.learning_rate


class GlidingMesh(torch.nn.Module):
    """Positions of a mesh on a surface whose inner vertices move through their parameters."""

    def __init__(self, mesh: ShapeMesh, rows: int) -> None:
        super().__init__()
        self.mesh = mesh
        self.shift = torch.nn.Parameter(torch.zeros_like(mesh.parameters))
        ends = torch.tensor(mesh.surface.domain, dtype=mesh.parameters.dtype)
        edges = (ends[:, 1] - ends[:, 0]) / rows
        self.scale = edges * (~mesh.topology.is_boundary_vertex)[:, None]

    def parameters_of_vertices(self) -> Tensor:
        """U and v (V, 2), kept inside the patch."""
        low, high = torch.tensor(self.mesh.surface.domain, dtype=self.shift.dtype).T
        return torch.minimum(torch.maximum(self.mesh.parameters + self.scale * self.shift, low), high)

    def forward(self) -> Tensor:
        """Positions (V, 3)."""
        return self.mesh.surface.position(*self.parameters_of_vertices().unbind(-1))

    def flipped_faces(self) -> int:
        """Faces that turn their back to the side of the surface normal."""
        with torch.no_grad():
            triangles = self.mesh.topology.triangles
            middles = self.parameters_of_vertices()[triangles].mean(1)
            normals = self.mesh.surface.normal(*middles.unbind(-1))
            return int(((normals * face_normals(self(), self.mesh.topology)).sum(-1) <= 0).sum())


def other_views(setup: ReflectionSetup) -> ReflectionSetup:
    """Six views between those of the loss."""
    camera = setup.camera
    between = cone_directions(camera.axes[0, 2], 30.0, 7)[1:]
    turn = math.radians(77)
    forward = camera.axes[0, 2]
    across = torch.linalg.cross(forward.expand_as(between), between)
    along = (between @ forward)[:, None] * forward
    turned = along + math.cos(turn) * (between - along) + math.sin(turn) * across
    assert setup.reference is not None  # it was made for one
    views = OrthographicCamera.fit(setup.reference.vertices, directions=turned)
    return replace(setup, camera=views)


def measure(model: GlidingMesh, setup: ReflectionSetup, others: ReflectionSetup) -> Report:
    """Score, energies and faces."""
    with torch.no_grad():
        vertices, topology = model(), model.mesh.topology
    score = reflection_score(vertices, topology, setup)
    return {
        "score": score.score,
        "score_in_other_views": reflection_score(vertices, topology, others).score,
        "reflection_variation": score.reflection_variation,
        "rms": score.rms,
        "wobble": score.wobble,
        "normal_variation": normal_variation(vertices, topology),
        "flipped_faces": model.flipped_faces(),
        "smallest_angle_degrees": angles.corner_angles(vertices, topology).min().rad2deg(),
    }


def optimise(
    model: GlidingMesh, loss: Callable[[Tensor], Tensor], judge: Callable[[], Report], name: str, config: Config,
    results: Results,
) -> tuple[Report, Training]:  # fmt: skip
    """Steps of Adam, to the state of the least loss; what ``judge`` says at the start and in training."""
    first = {"step": 0, **judge()}

    def terms() -> dict[str, Tensor]:
        return {"loss": loss(model())}

    def validate() -> dict[str, float]:
        return {"validation": float(loss(model())), **{key: float(value) for key, value in judge().items()}}

    generator = torch.Generator()  # nothing is random
    training = train(model, terms, validate, name=name, config=config, results=results, generator=generator)
    return first, training


def small_angles(vertices: Tensor, topology: Topology, degrees: float) -> Tensor:
    """Sum of ``(1 - angle / degrees)^2`` over the corners with smaller angles, divided by the number of vertices."""
    short = torch.relu(1 - angles.corner_angles(vertices, topology) / math.radians(degrees))
    return short.square().sum() / topology.num_vertices


def run_surface(
    name: str, config: Config, results: Results
) -> tuple[dict[str, Report], dict[str, Tensor], SmoothReference, ShapeMesh]:
    """All losses on one surface, until Ctrl-C: figures and positions by loss."""
    reference = SmoothReference.of_surface(SADDLES[name])
    setup = ReflectionSetup.for_reference(reference, size=config.judged_size)
    others = other_views(setup)
    mesh = layout(SADDLES[name], IRREGULAR, config.rows, config.seed)
    both = ReflectionLoss(mesh.topology, setup, variation_weight=config.weight, size=config.size)
    losses: dict[str, Callable[[Tensor], Tensor]] = {BOTH: both, SCORE: both.dissimilarity, ENERGY: both.variation}
    report, positions = {}, {START: mesh.vertices}
    for kind, loss in losses.items():
        model = GlidingMesh(mesh, config.rows)

        def total(vertices: Tensor, loss: Callable[[Tensor], Tensor] = loss) -> Tensor:
            return loss(vertices) + config.shape * small_angles(vertices, mesh.topology, config.smallest_angle)

        run = run_name(name, kind)
        first, training = optimise(model, total, partial(measure, model, setup, others), run, config, results)
        last, history = training.best, [first, *training.records]
        if not training.records:
            report[kind] = {"start": first, "interrupted": True}
            break
        changes = {f"{key}_change": float(last[key] / first[key]) - 1
                   for key in ("score", "score_in_other_views", "normal_variation", "wobble")}  # fmt: skip
        interrupted = training.interrupted
        report[kind] = {"start": first, "end": last, **changes, "history": history, "interrupted": interrupted}
        positions[kind] = model().detach()
        print(f"{name}, {kind}: {describe(report[kind])}")
        if interrupted:
            break
    return report, positions, reference, mesh


def run_name(surface: str, loss: str) -> str:
    """Of the files of one training."""
    return f"{surface}_{('both', 'score', 'energy')[LOSSES.index(loss)]}"


def describe(row: Report) -> str:
    """The changes in words."""
    first, last = row["start"], row["end"]
    keys = ("score", "score_in_other_views", "normal_variation")
    percent = {key: f"{100 * row[f'{key}_change']:+.1f} %" for key in keys}
    return (
        f"score {first['score']:.4f} -> {last['score']:.4f} ({percent['score']}; other views "
        f"{percent['score_in_other_views']}), E {first['normal_variation']:.4f} -> {last['normal_variation']:.4f} "
        f"({percent['normal_variation']}), {last['flipped_faces']:.0f} flipped faces"
    )


def draw_meshes(
    positions: dict[str, Tensor], reference: SmoothReference, mesh: ShapeMesh, report: dict[str, Report],
    config: Config, results: Results,
) -> None:  # fmt: skip
    """Stripes in two directions: the start, what came of it, and the smooth surface."""
    setup = ReflectionSetup.for_reference(reference)
    mirrors = {name: Mirror(vertices, mesh.topology) for name, vertices in positions.items()}
    mirrors["smooth surface"] = smooth_mirror(reference)
    camera, pixels = fit_camera(
        reference.vertices, towards_eye=-setup.camera.axes[0, 2], up=setup.camera.axes[0, 1],
        width=panel_width(config.width, len(mirrors)), margin=0.02,
    )  # fmt: skip
    waves = setup.stripes.waves
    frequency = float(torch.linalg.vector_norm(waves[0])) / (2 * math.pi)
    rows = [[mirror_picture(m, camera, pixels, striped(wave, frequency), joints=0.4) for m in mirrors.values()]
            for wave in waves[:2]]  # fmt: skip
    values = {START: report[BOTH]["start"]} | {kind: report[kind]["end"] for kind in LOSSES}
    captions = {name: [f"score {values[name]['score']:.3f},  $E$ = {values[name]['normal_variation']:.2f}"]
                if name in values else [""] for name in mirrors}  # fmt: skip
    panels(rows, config.width, captions).write(results.path(PICTURE), overwrite=results.force)
    for file, vertices in zip(MESHES, positions.values(), strict=True):
        results.mesh(file, vertices, mesh.topology)


def draw_history(surfaces: dict[str, dict[str, Report]], results: Results) -> None:
    """Score and E over the steps, a column for each surface."""
    sheet = Sheet(180 + 560 * len(surfaces), 1060)
    titles = {"score": "reflection score", "normal_variation": "$E$"}
    for column, (name, report) in enumerate(surfaces.items()):
        for row, (key, words) in enumerate(titles.items()):
            axes = add_chart(
                sheet, 150 + column * 560, 150 + row * 450, 450, 340, title=name if row == 0 else "",
                x="steps" if row else "", y=words if column == 0 else "",
            )  # fmt: skip
            for kind in LOSSES:
                history = report[kind]["history"]
                axes.plot(
                    [h["step"] for h in history], [float(h[key]) for h in history], color=COLORS[kind], label=kind
                )
    add_legend(sheet.figure, handles=axes.get_lines(), loc="upper center", ncols=3)
    sheet.write(results.path(CHART), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Optimises, measures, draws."""
    surfaces: dict[str, dict[str, Report]] = {}
    for number, name in enumerate(config.surfaces):
        surfaces[name], positions, reference, mesh = run_surface(name, config, results)
        if any(row["interrupted"] for row in surfaces[name].values()):
            return {"surfaces": surfaces, "interrupted": True}
        if number == 0:
            draw_meshes(positions, reference, mesh, surfaces[name], config, results)
    draw_history(surfaces, results)
    return {"surfaces": surfaces}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    trained = [file for name in SADDLES for loss in LOSSES for file in training_files(run_name(name, loss))]
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, CHART, *MESHES, *trained], arguments)


if __name__ == "__main__":
    sys.exit(main())
