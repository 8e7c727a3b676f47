r"""Amortised form-finding: a network from boundary curves to surfaces of small C, trained by the energy itself.

Boundaries are closed curves over a square with random heights. The network moves the inner vertices of the harmonic
surface with the given boundary, a triangle lattice over the square, so that C falls::

    loss = mean over the boundaries of a batch of (C + share * E) / C of the harmonic surface

No solved example is needed. E is there because C does not see zigzags. On boundaries that were not trained on the
network is compared with the solver (``minimise_absolute_curvature``), which starts from the harmonic surface and from
that of the network: C, seconds, and the steps until C is within a per cent of where the first of them ends.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from typing import Any

import torch
from _common import Report, Results, run_experiment, setting
from _training import Training, TrainingConfig, train, training_files
from torch import Tensor, nn

from torchfair import Topology
from torchfair.energies import NormalVariation, TotalAbsoluteCurvature
from torchfair.formfinding import minimise_absolute_curvature
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet
from torchfair.viewing.wireframe import quiet_edges

NAME = "train_form_finding"
RUN, PICTURE = "network", "surfaces.png"
SURFACES = ("harmonic", "network", "solver")


@dataclass(frozen=True)
class Config(TrainingConfig):
    """Settings of the experiment."""

    steps: int = setting(1200, "optimiser steps", least=1)
    learning_rate: float = setting(0.003, "of Adam at the start; falls to 0 like half a cosine wave", least=0)
    log_every: int = setting(100, "steps between log lines, validations and checkpoints", least=1)
    dtype: str = setting("float32", "precision", choices=("float32", "float64"))
    rows: int = setting(11, "vertices along a side of the square", least=4)
    waves: int = setting(2, "highest frequency of the heights along the boundary", least=1)
    height: float = setting(0.4, "standard deviation of the heights; the square has sides of 2", least=0)
    batch: int = setting(16, "boundaries per step", least=1)
    hidden: int = setting(192, "width of the network", least=1)
    share: float = setting(0.02, "of E in the loss", least=0)
    validation_boundaries: int = setting(64, "boundaries to choose the best state by", least=1)
    unseen: int = setting(8, "boundaries to compare with the solver on", least=1)


# ---- surfaces over a square ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Square:
    """A triangle lattice over [-1, 1]^2.

    Attributes:
        plan: (V, 2) places of its vertices.
        topology: its triangles.
        rim: (n,) boundary vertices, in order.
        inner: (m,) the others.
        harmonic: (m, n) heights inside as means of those on the rim.
    """

    plan: Tensor
    topology: Topology
    rim: Tensor
    inner: Tensor
    harmonic: Tensor

    @classmethod
    def of_rows(cls, rows: int) -> Square:
        """With so many vertices along a side."""
        steps = torch.linspace(-1, 1, rows, dtype=torch.float64)
        plan = torch.cartesian_prod(steps, steps)
        corner = (torch.arange(rows - 1)[:, None] * rows + torch.arange(rows - 1)).flatten()
        a, b, c, d = corner, corner + rows, corner + rows + 1, corner + 1
        turned = ((corner // rows + corner % rows) % 2 == 1)[:, None]  # diagonals in turn, so that none is preferred
        first = torch.where(turned, torch.stack([a, b, d], 1), torch.stack([a, b, c], 1))
        second = torch.where(turned, torch.stack([b, c, d], 1), torch.stack([a, c, d], 1))
        topology = Topology.from_faces(torch.cat([first, second]))
        rim = topology.boundary_loops()[0]
        inner = (~topology.is_boundary_vertex).nonzero().squeeze(1)
        matrix = torch.zeros(rows * rows, rows * rows, dtype=torch.float64)
        for v, w in topology.edges.tolist():
            matrix[v, w] = matrix[w, v] = -1.0
        matrix -= torch.diag(matrix.sum(1))
        return cls(plan, topology, rim, inner, -torch.linalg.solve(matrix[inner][:, inner], matrix[inner][:, rim]))

    def harmonic_surface(self, rim_heights: Tensor) -> Tensor:
        """Vertices (*batch, V, 3) of the surface that the network starts from."""
        batch = rim_heights.shape[:-1]
        heights = rim_heights.new_zeros(*batch, self.plan.shape[0])
        inside = rim_heights @ self.harmonic.to(rim_heights).T
        heights = heights.index_copy(-1, self.rim, rim_heights).index_copy(-1, self.inner, inside)
        plan = self.plan.to(heights).expand(*batch, -1, -1)
        return torch.cat([plan, heights[..., None]], dim=-1)


def random_heights(square: Square, count: int, config: Config, generator: torch.Generator) -> Tensor:
    """(count, n) heights of rims: trigonometric polynomials of the angle around the middle."""
    places = square.plan[square.rim]
    angles = torch.atan2(places[:, 1], places[:, 0])
    orders = torch.arange(1, config.waves + 1, dtype=torch.float64)
    basis = torch.cat([(orders[:, None] * angles).cos(), (orders[:, None] * angles).sin()])
    factors = torch.randn(count, 2 * config.waves, generator=generator, dtype=torch.float64)
    return config.height / math.sqrt(config.waves) * factors @ basis


class FormFinder(nn.Module):
    """Heights on the rim to vertices of a surface.

    Args:
        square: where it stands.
        hidden: width of the layers.
    """

    def __init__(self, square: Square, hidden: int) -> None:
        super().__init__()
        self.square = square
        rim, inner = len(square.rim), len(square.inner)
        self.layers = nn.Sequential(
            nn.Linear(rim, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU(), nn.Linear(hidden, 3 * inner)
        )  # fmt: skip
        nn.init.zeros_(self.layers[-1].weight)  # type: ignore[arg-type]
        nn.init.zeros_(self.layers[-1].bias)  # type: ignore[arg-type]

    def forward(self, rim_heights: Tensor) -> Tensor:
        """Vertices (*batch, V, 3) of ``rim_heights`` (*batch, n)."""
        moves = self.layers(rim_heights).unflatten(-1, (-1, 3))
        return self.square.harmonic_surface(rim_heights).index_add(-2, self.square.inner, moves)


# ---- training and comparison ---------------------------------------------------------------------------


def fit(square: Square, config: Config, results: Results) -> tuple[FormFinder, Training]:
    """The network in its best state."""
    torch.manual_seed(config.seed)
    model = FormFinder(square, config.hidden).to(**config.place)
    curvature, energy = TotalAbsoluteCurvature(square.topology), NormalVariation(square.topology)
    generator = torch.Generator().manual_seed(config.seed)
    others = random_heights(square, config.validation_boundaries, config, torch.Generator().manual_seed(10_000))
    others = others.to(**config.place)

    def ratio(heights: Tensor, share: float) -> Tensor:
        vertices = model(heights)
        start = curvature(square.harmonic_surface(heights))
        return ((curvature(vertices) + share * energy(vertices)) / start).mean()

    def terms() -> dict[str, Tensor]:
        heights = random_heights(square, config.batch, config, generator).to(**config.place)
        return {"loss": ratio(heights, config.share)}

    def validate() -> dict[str, float]:
        return {
            "validation": float(ratio(others, config.share)),
            "c_over_harmonic": float(ratio(others, 0.0)),
        }

    return model, train(
        model, terms, validate, name=RUN, config=config, results=results, generator=generator
    )  # fmt: skip


def solve(start: Tensor, square: Square) -> tuple[Tensor, list[float], float]:
    """Vertices of the solver's result, C after each of its steps, and processor seconds."""
    course: list[float] = []
    begin = time.process_time()
    result = minimise_absolute_curvature(
        start, square.topology, callback=lambda record: course.append(record.quantities["total_absolute_curvature"])
    )
    return result.vertices, course, time.process_time() - begin


def compare(model: FormFinder, square: Square, config: Config) -> tuple[Report, dict[str, Tensor]]:
    """Network and solver on boundaries that neither training nor validation has seen."""
    curvature = TotalAbsoluteCurvature(square.topology)
    heights = random_heights(square, config.unseen, config, torch.Generator().manual_seed(20_000))
    with torch.no_grad():
        begin = time.process_time()
        found = model(heights.to(**config.place)).double()
        seconds = (time.process_time() - begin) / config.unseen
    rows, first = [], dict[str, Tensor]()
    for number, rim in enumerate(heights):
        start = square.harmonic_surface(rim)
        cold, cold_course, cold_seconds = solve(start, square)
        warm, warm_course, warm_seconds = solve(found[number], square)
        surfaces = {"harmonic": start, "network": found[number], "solver": cold, "solver, warm": warm}
        values = {name: float(curvature(vertices)) for name, vertices in surfaces.items()}
        goal = 1.01 * values["solver"]
        row: dict[str, Any] = {**values, "cold_seconds": cold_seconds, "warm_seconds": warm_seconds}
        row |= {"cold_steps": steps_until(goal, cold_course), "warm_steps": steps_until(goal, warm_course)}
        rows.append(row)
        first = first or {name: surfaces[name] for name in SURFACES}
    reached = [row for row in rows if row["warm_steps"] is not None and row["cold_steps"] is not None]
    gaps = [row["network"] / min(row["solver"], row["solver, warm"]) - 1 for row in rows]
    report = {
        "rows": rows,
        "network_seconds": seconds,
        "harmonic_over_solver": _mean([row["harmonic"] / min(row["solver"], row["solver, warm"]) for row in rows]),
        "network_gap": _mean(gaps),
        "largest_network_gap": max(gaps),
        "cold_seconds": _mean([row["cold_seconds"] for row in rows]),
        "warm_seconds": _mean([row["warm_seconds"] for row in rows]),
        "cold_steps": _mean([row["cold_steps"] for row in reached]),
        "warm_steps": _mean([row["warm_steps"] for row in reached]),
        "warm_start_reaches_the_goal": len(reached) / len(rows),
        "warm_better_by": _mean([row["solver"] / row["solver, warm"] - 1 for row in rows]),
    }
    return report, first


def steps_until(goal: float, course: list[float]) -> int | None:
    """Steps until C is no more than ``goal``, None if it never is."""
    return next((step for step, value in enumerate(course, 1) if value <= goal), None)


def _mean(values: list[Any]) -> float:
    return sum(values) / len(values) if values else math.nan


def draw_surfaces(surfaces: dict[str, Tensor], square: Square, width: int, results: Results) -> None:
    """One boundary, side by side."""
    curvature = TotalAbsoluteCurvature(square.topology)
    towards_eye, up = view_direction(surfaces["solver"], square.topology)
    panel = (width - 2 * MARGIN - (len(surfaces) - 1) * GAP) // len(surfaces)
    camera, size = fit_camera(*surfaces.values(), towards_eye=towards_eye, up=up, width=panel)
    sheet = Sheet(width, CAPTION + size[0] + 2 * MARGIN)
    for column, (name, vertices) in enumerate(surfaces.items()):
        left = MARGIN + column * (panel + GAP)
        sheet.caption(f"{name}:  $C$ = {float(curvature(vertices)):.2f}", left, 0, panel)
        mesh = MeshView(vertices, square.topology, camera, size)
        colors = shade_faces(vertices, square.topology, camera)
        sheet.image(mesh.paint(colors, edges=quiet_edges(mesh)), left, CAPTION)
    sheet.write(results.path(PICTURE), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Trains, compares, draws."""
    square = Square.of_rows(config.rows)
    model, training = fit(square, config, results)
    report: Report = {"training": training, "interrupted": training.interrupted}
    if training.interrupted:
        return report
    report["unseen"], surfaces = compare(model, square, config)
    found = report["unseen"]
    print(
        f"C of the network {100 * found['network_gap']:.1f} % above the solver's (harmonic surface "
        f"{100 * (found['harmonic_over_solver'] - 1):.1f} %), {1e3 * found['network_seconds']:.2f} ms against "
        f"{found['cold_seconds']:.2f} s; steps of the solver until C is within 1 % of its own result: "
        f"{found['cold_steps']:.1f} from the harmonic surface, {found['warm_steps']:.1f} from the network "
        f"({100 * found['warm_start_reaches_the_goal']:.0f} % of {config.unseen} get there); from the network it ends "
        f"{100 * found['warm_better_by']:.1f} % lower"
    )
    draw_surfaces(surfaces, square, config.width, results)
    for name, vertices in surfaces.items():
        results.mesh(f"{name}.obj", vertices, square.topology)
    return report


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [PICTURE, *(f"{name}.obj" for name in SURFACES), *training_files(RUN)]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
