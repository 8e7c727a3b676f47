"""Handles are found so that the finished mesh, which a whole job makes of them, does what is wanted.

Designs with hidden handles are made, and found again from what they do: a surface of least C from points that it
passes through, a mesh of least E from pictures of stripes that it mirrors (`--designs reflection`). What is wanted is a
function of the finished mesh, the mesh a function of its handles (`JobLayer`): Adam finds these with gradients through
the solve. The same, from the same start, with gradients by implicit differentiation, by unrolling ten Gauss-Newton
steps, and (for a few steps only) by finite differences.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Literal

import torch
from _charts import BLUE, GREEN, ORANGE, RED, add_chart, add_legend
from _common import Report, Results, run_experiment
from _hidden_designs import FREQUENCY, STRIPES, Config, Design, feet_of, mirroring, through_points
from _mirrors import Mirror, mirror_picture, panel_width, panels, striped
from torch import Tensor

from torchfair.errors import DerivativeError
from torchfair.formfinding import JobLayer
from torchfair.geometry import vertex_normals
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet, points
from torchfair.viewing.wireframe import quiet_edges

NAME = "inverse_design"
PICTURE, POINTS, CHART = "reflections.png", "points.png", "losses.png"
MESHES = ("points_start.obj", "points_found.obj", "reflection_start.obj", "reflection_found.obj")
IMPLICIT, UNROLLED, DIFFERENCES = "implicit", "unrolled", "finite differences"
WAYS = (IMPLICIT, UNROLLED, DIFFERENCES)
COLORS = {IMPLICIT: BLUE, UNROLLED: ORANGE, DIFFERENCES: GREEN}


# ---- finding it ----------------------------------------------------------------------------------------


class Search:
    """The loss of a design as a function of its handles, and its gradient one way or another.

    Every mesh is finished from the last one that was finished, not by the whole job. Handles are told in mean edges
    from where they start.
    """

    def __init__(self, design: Design, way: str, config: Config) -> None:
        self.design, self.way, self.step = design, way, config.difference
        backward: Literal["implicit", "unroll"] = "unroll" if way == UNROLLED else "implicit"
        self.layer = JobLayer(design.recipe, backward=backward, tolerance=config.tolerance)
        self.targets = design.recipe.given[torch.tensor(list(design.recipe.handles))]
        self.mesh, _ = self.layer({"targets": self.targets})
        self.best, self.seconds = math.inf, time.process_time()
        self.history: list[dict[str, float]] = []
        self.solves, self.faults, self.unit = 0, 0, design.recipe.unit.length
        self.last_fault = ""

    def __call__(self, at: Tensor) -> Tensor | None:
        """The gradient (h, 3) at handles (h, 3), noted with the loss; None where no mesh is finished."""
        try:
            loss, slope = self.by_differences(at) if self.way == DIFFERENCES else self.by_layer(at)
        except DerivativeError as error:
            self.faults += 1
            self.last_fault = str(error)
            return None
        self.best = min(self.best, loss)
        self.history.append({"loss": self.best, "seconds": time.process_time() - self.seconds, "solves": self.solves})
        return slope

    def finished(self, at: Tensor, start: Tensor) -> Tensor:
        self.solves += 1
        mesh, info = self.layer({"targets": self.targets + self.unit * at}, start=start)
        assert not isinstance(info, list), "there is no batch"
        if info.point.fault:
            raise DerivativeError(info.point.fault)
        return mesh

    def by_layer(self, at: Tensor) -> tuple[float, Tensor]:
        at = at.clone().requires_grad_()
        mesh = self.finished(at, self.mesh)
        loss = self.design.loss(mesh)
        (slope,) = torch.autograd.grad(loss, at)
        self.mesh = mesh.detach()
        return float(loss.detach()), slope

    def by_differences(self, at: Tensor) -> tuple[float, Tensor]:
        """Forward differences, one mesh finished for every coordinate."""
        with torch.no_grad():
            self.mesh = self.finished(at, self.mesh)
            loss, slope = float(self.design.loss(self.mesh)), torch.zeros_like(at)
            for number in range(at.numel()):
                there = at.clone()
                there.view(-1)[number] += self.step
                slope.view(-1)[number] = (float(self.design.loss(self.finished(there, self.mesh))) - loss) / self.step
        return loss, slope


def found_by(design: Design, way: str, config: Config) -> tuple[Report, Tensor]:
    """What Adam finds with gradients of a kind; a step after which no mesh is finished is taken back by half."""
    search = Search(design, way, config)
    at = torch.zeros_like(design.hidden, requires_grad=True)
    adam, total = torch.optim.Adam([at], lr=config.rate, betas=(0.8, 0.99)), config.steps
    fall = torch.optim.lr_scheduler.CosineAnnealingLR(adam, total)
    begin = search.seconds = time.process_time()
    for _ in range(config.difference_steps if way == DIFFERENCES else total):
        before = at.detach().clone()
        if at.grad is not None:
            adam.step()
            fall.step()
        slope = search(at.detach())
        while slope is None and search.faults < total:
            at.data.lerp_(before, 0.5)
            slope = search(at.detach())
        if slope is not None:
            at.grad = slope
    seconds, unit = time.process_time() - begin, search.unit
    targets, mesh = search.targets + unit * at.detach(), search.mesh
    return {
        "first_loss": search.history[0]["loss"],
        "loss": search.best,
        "cpu_seconds": seconds,
        "gradients": len(search.history),
        "seconds_per_gradient": seconds / len(search.history),
        "solves": search.solves,
        "faults": search.faults,
        "last_fault": search.last_fault,
        "handles_off": float((targets - design.hidden).norm(dim=1).max()) / unit,
        "mesh_off": float((mesh - wanted_mesh(design)).norm(dim=1).max()) / unit,
        "history": search.history,
    }, mesh


def wanted_mesh(design: Design) -> Tensor:
    """The finished hidden design."""
    mesh, _ = JobLayer(design.recipe)({"targets": design.hidden})
    return mesh


def gradients_compared(design: Design, config: Config) -> Report:
    """Errors of gradients at the start, relative to central differences of meshes finished again."""
    slopes = {}
    for way in (IMPLICIT, UNROLLED):
        slopes[way] = Search(design, way, config).by_layer(torch.zeros_like(design.hidden))[1]
    search = Search(design, DIFFERENCES, config)
    exact = torch.zeros(design.hidden.numel(), dtype=torch.float64)
    for number in range(len(exact)):
        ends = []
        for sign in (1.0, -1.0):
            there = torch.zeros_like(design.hidden)
            there.view(-1)[number] = sign * config.difference
            ends.append(float(design.loss(search.finished(there, search.mesh))))
        exact[number] = (ends[0] - ends[1]) / (2 * config.difference)
    exact = exact.view_as(design.hidden)
    return {way: float((slope - exact).norm() / exact.norm()) for way, slope in slopes.items()}


# ---- pictures ------------------------------------------------------------------------------------------


def draw_losses(designs: dict[str, Report], results: Results) -> None:
    """The best loss so far over processor time, a chart for each design."""
    sheet = Sheet(180 + 760 * len(designs), 700)
    titles = {"points": "points on a surface of least $C$", "reflection": "stripes in a mesh of least $E$"}
    for column, (name, report) in enumerate(designs.items()):
        axes = add_chart(sheet, 170 + column * 760, 130, 600, 430, title=titles[name], x="seconds of one core",
                         y="loss over that of the start" if column == 0 else "")  # fmt: skip
        for way in WAYS:
            rows = report[way]["history"]
            axes.plot([row["seconds"] for row in rows], [row["loss"] / rows[0]["loss"] for row in rows],
                      color=COLORS[way], label=way, marker="o", markersize=3)  # fmt: skip
        axes.set_yscale("log")
    add_legend(sheet.figure, handles=axes.get_lines(), loc="upper center", ncols=3)
    sheet.write(results.path(CHART), overwrite=results.force)


def draw_points(meshes: dict[str, Tensor], design: Design, width: int, results: Results) -> None:
    """The points, joined in red to the places of each mesh that are closest to them."""
    assert design.points is not None, "this design has no points"
    topology, unit = design.recipe.topology, design.recipe.unit.length
    towards_eye, up = view_direction(meshes["hidden design"], topology)
    panel = panel_width(width, len(meshes))
    camera, size = fit_camera(*meshes.values(), towards_eye=towards_eye, up=up, width=panel)
    sheet = Sheet(width, CAPTION + size[0] + 2 * MARGIN)
    for column, (name, vertices) in enumerate(meshes.items()):
        left = MARGIN + column * (panel + GAP)
        mesh, feet = MeshView(vertices, topology, camera, size), feet_of(design.points, vertices, topology)
        off = float((feet - design.points).square().sum(1).mean().sqrt()) / unit
        sheet.caption(f"{name}: points off by {off:.2f} mean edges", left, 0, panel)
        axes = sheet.axes(left, CAPTION, size[1], size[0])
        axes.set_axis_off()
        picture = mesh.paint(shade_faces(vertices, topology, camera), edges=quiet_edges(mesh))
        axes.imshow(picture.clamp(0, 1).numpy(), extent=(0, size[1], size[0], 0), interpolation="none")
        ends = torch.stack([camera.project(places, size)[0] for places in (design.points, feet)])[..., :2]
        axes.plot(*ends.unbind(-1), color=RED, linewidth=points(6))
        axes.plot(*ends[0].T, "o", color=BLUE, markersize=points(13), markeredgecolor="white")
    sheet.write(results.path(POINTS), overwrite=results.force)


def draw_reflections(meshes: dict[str, Tensor], design: Design, config: Config, results: Results) -> None:
    """Stripes of both directions in the start, what was found, and what was wanted."""
    topology = design.recipe.topology
    camera, pixels = fit_camera(
        meshes["hidden design"], towards_eye=torch.tensor([0.4, -0.5, 1.0]), up=torch.tensor([0.0, 0.0, 1.0]),
        width=panel_width(config.width, len(meshes)), margin=0.02,
    )  # fmt: skip
    mirrors = [Mirror(mesh, topology, vertex_normals(mesh, topology)) for mesh in meshes.values()]
    rows = [
        [mirror_picture(mirror, camera, pixels, striped(wave, 2 * FREQUENCY)) for mirror in mirrors] for wave in STRIPES
    ]
    panels(rows, config.width, {name: [""] for name in meshes}).write(results.path(PICTURE), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Both designs, each in three ways."""
    designs = {}
    for design in [{"points": through_points, "reflection": mirroring}[name](config) for name in config.designs]:
        report: Report = {"vertices": design.recipe.topology.num_vertices, "unknowns": design.hidden.numel()}
        report["errors_of_gradients"] = gradients_compared(design, config)
        print(f"{design.name}: errors of gradients at the start {report['errors_of_gradients']}", flush=True)
        found = {}
        for way in WAYS:
            report[way], found[way] = found_by(design, way, config)
            print(
                f"{design.name}, {way}: "
                + ", ".join(f"{k} {v:.3g}" for k, v in report[way].items() if isinstance(v, float | int)),
                flush=True,
            )
        designs[design.name] = report
        start, _ = JobLayer(design.recipe)()
        results.mesh(f"{design.name}_start.obj", start, design.recipe.topology)
        results.mesh(f"{design.name}_found.obj", found[IMPLICIT], design.recipe.topology)
        meshes = {"start": start, "found": found[IMPLICIT], "hidden design": wanted_mesh(design)}
        if design.points is not None:
            draw_points(meshes, design, config.width, results)
        else:
            draw_reflections(meshes, design, config, results)
    draw_losses(designs, results)
    return {"designs": designs}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, POINTS, CHART, *MESHES], arguments)


if __name__ == "__main__":
    sys.exit(main())
