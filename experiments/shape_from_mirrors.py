"""A surface is recovered from pictures of stripes that it mirrors.

A smooth height field is seen as a mirror from several sides, with stripes around it, in noisy pictures. A mesh of free
heights (its boundary is known) is fitted to these by gradients through the renderer: from wide stripes to narrow ones,
since narrow ones match in many wrong places. Alone, and with the energy E as a regulariser.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _charts import BLUE, ORANGE, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _mirrors import Mirror, mirror_picture, panel_width, panels, striped
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import OrthographicCamera
from torchfair.energies import normal_variation, total_absolute_curvature
from torchfair.geometry import vertex_normals
from torchfair.reflection import Stripes, cone_directions, render_reflection
from torchfair.viewing import fit_camera
from torchfair.viewing.sheet import Sheet

NAME = "shape_from_mirrors"
PICTURE, CHART = "surfaces.png", "errors.png"
ALONE, WITH_ENERGY = "pictures alone", "pictures and E"
WAYS = (ALONE, WITH_ENERGY)
COLORS = {ALONE: ORANGE, WITH_ENERGY: BLUE}
MESHES = ("surface.obj", "pictures_alone.obj", "pictures_and_e.obj")
WAVES = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.7, 0.7, 0.0]], dtype=torch.float64)
UP = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    rows: int = setting(16, "cells along the mesh", least=4)
    fine: int = setting(64, "cells along the surface that is seen", least=8)
    views: int = setting(5, "pictures", least=1)
    size: int = setting(64, "pixels along a picture", least=16)
    noise: float = setting(0.1, "of every pixel; stripes go from 0 to 1", least=0)
    frequencies: tuple[float, ...] = setting(
        (0.5, 1.0, 2.0), "pairs of stripes over half the sphere, stage by stage", least=0.1
    )
    steps: int = setting(100, "steps of Adam in every stage", least=1)
    rate: float = setting(0.03, "learning rate at first, in mean edges; falls by a cosine", least=1e-6)
    energy: float = setting(3e-4, "weight of E, over that of the mean squared error of pixels", least=0)


def height(x: Tensor, y: Tensor) -> Tensor:
    """The surface that is to be found, over the square from -1 to 1."""
    return 0.25 * x * x - 0.15 * y * y + 0.12 * torch.exp(-4.0 * ((x - 0.3) ** 2 + (y + 0.2) ** 2))


def grid(rows: int) -> tuple[Tensor, Topology]:
    """A triangulated square at height 0, with diagonals either way."""
    x, y = torch.meshgrid(*(torch.linspace(-1.0, 1.0, rows + 1, dtype=torch.float64),) * 2, indexing="ij")
    number = torch.arange((rows + 1) ** 2).view(rows + 1, rows + 1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    odd = ((torch.arange(rows)[:, None] + torch.arange(rows)) % 2 == 1)[..., None]
    first = torch.where(odd, torch.stack([a, b, d], -1), torch.stack([a, b, c], -1))
    second = torch.where(odd, torch.stack([b, c, d], -1), torch.stack([a, c, d], -1))
    faces = torch.cat([first.reshape(-1, 3), second.reshape(-1, 3)])
    return torch.stack([x, y, torch.zeros_like(x)], -1).reshape(-1, 3), Topology.from_faces(faces)


def on_surface(points: Tensor) -> Tensor:
    """Points (V, 3) put on the surface."""
    return torch.stack([points[:, 0], points[:, 1], height(points[:, 0], points[:, 1])], dim=1)


class Photographs:
    """Noisy pictures of the surface, one set for each frequency of stripes."""

    def __init__(self, config: Config) -> None:
        self.config = config
        flat, self.topology = grid(config.fine)
        self.surface = on_surface(flat)
        self.camera = OrthographicCamera.fit(self.surface, directions=cone_directions(-UP, 30.0, config.views))
        generator = torch.Generator().manual_seed(config.seed)
        self.taken: dict[float, Tensor] = {}
        for frequency in config.frequencies:
            clean = self.render(self.surface, self.topology, frequency)
            noise = torch.randn(clean.shape, generator=generator, dtype=clean.dtype)
            self.taken[frequency] = clean + config.noise * noise

    def render(self, vertices: Tensor, topology: Topology, frequency: float) -> Tensor:
        """(views, channels, size, size), smoothly shaded."""
        stripes = Stripes(WAVES, frequency, 2.0)
        return render_reflection(
            vertices, topology, self.camera, stripes, size=self.config.size, shading="smooth"
        ).image

    def error(self, vertices: Tensor, topology: Topology, frequency: float) -> Tensor:
        """Mean squared error of pixels."""
        return (self.render(vertices, topology, frequency) - self.taken[frequency]).square().mean()


def recovered(photographs: Photographs, weight: float, config: Config) -> tuple[Report, Tensor]:
    """Heights that explain the pictures, with E of a weight."""
    flat, topology = grid(config.rows)
    truth, free = on_surface(flat), ~topology.is_boundary_vertex
    edge = 2.0 / config.rows
    shift = torch.zeros(len(flat), dtype=torch.float64, requires_grad=True)
    history, total = [], config.steps * len(config.frequencies)
    adam = torch.optim.Adam([shift], lr=config.rate)
    fall = torch.optim.lr_scheduler.LambdaLR(
        adam, lambda step: 0.5 * (1.0 + math.cos(math.pi * min(1.0, step / total)))
    )

    def mesh() -> Tensor:
        heights = torch.where(free, edge * shift, truth[:, 2])
        return torch.stack([flat[:, 0], flat[:, 1], heights], dim=1)

    def errors() -> Report:
        with torch.no_grad():
            away = (mesh() - truth)[free, 2]
            cosines = (vertex_normals(mesh(), topology) * vertex_normals(truth, topology)).sum(1)[free].clamp(-1, 1)
        return {"rms": float(away.square().mean().sqrt()) / edge, "degrees": float(cosines.acos().rad2deg().mean())}

    for frequency in config.frequencies:
        for _ in range(config.steps):
            history.append(errors())
            adam.zero_grad()
            vertices = mesh()
            loss = photographs.error(vertices, topology, frequency)
            if weight:
                loss = loss + weight * normal_variation(vertices, topology)
            loss.backward()
            adam.step()
            fall.step()
    with torch.no_grad():
        vertices = mesh()
        energy, curvature = (float(f(vertices, topology)) for f in (normal_variation, total_absolute_curvature))
        exact = float(normal_variation(truth, topology))
    return {
        **errors(),
        "start": history[0],
        "pixel_error": float(photographs.error(vertices, topology, config.frequencies[-1])) ** 0.5,
        "normal_variation": energy,
        "normal_variation_of_truth": exact,
        "total_absolute_curvature": curvature,
        "history": history,
    }, vertices


def draw_errors(report: dict[str, Report], results: Results) -> None:
    """Errors of heights and normals over the steps."""
    sheet = Sheet(1700, 700)
    for column, (key, words) in enumerate(
        {"rms": "error of heights, mean edges", "degrees": "error of normals, degrees"}.items()
    ):
        axes = add_chart(sheet, 170 + column * 800, 110, 620, 450, x="steps of Adam", y=words)
        for way in WAYS:
            axes.plot([row[key] for row in report[way]["history"]], color=COLORS[way], label=way)
        axes.set_yscale("log")
    add_legend(sheet.figure, handles=axes.get_lines(), loc="upper center", ncols=2)
    sheet.write(results.path(CHART), overwrite=results.force)


def draw_surfaces(
    meshes: dict[str, Tensor], topology: Topology, report: dict[str, Report], config: Config, results: Results
) -> None:
    """Stripes in the surface on the mesh, and in what was recovered."""
    camera, pixels = fit_camera(
        meshes["surface"], towards_eye=torch.tensor([0.5, -0.7, 1.0]), up=UP,
        width=panel_width(config.width, len(meshes)), margin=0.02,
    )  # fmt: skip
    mirrors = [Mirror(mesh, topology, vertex_normals(mesh, topology)) for mesh in meshes.values()]
    rows = [[mirror_picture(mirror, camera, pixels, striped(wave, 2.0)) for mirror in mirrors] for wave in WAVES[:2]]
    captions = {"surface": [f"$E$ = {report[ALONE]['normal_variation_of_truth']:.2f}"]}
    for name in WAYS:
        row = report[name]
        captions[name] = [f"normals off by {row['degrees']:.2f}°,  $E$ = {row['normal_variation']:.2f}"]
    panels(rows, config.width, captions).write(results.path(PICTURE), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Takes the pictures and recovers the surface in both ways."""
    photographs = Photographs(config)
    report, meshes = {}, {}
    flat, topology = grid(config.rows)
    meshes["surface"] = on_surface(flat)
    for way, weight in zip(WAYS, (0.0, config.energy), strict=True):
        report[way], meshes[way] = recovered(photographs, weight, config)
        print(
            f"{way}: " + ", ".join(f"{k} {v:.4g}" for k, v in report[way].items() if isinstance(v, float)), flush=True
        )
    for file, mesh in zip(MESHES, meshes.values(), strict=True):
        results.mesh(file, mesh, topology)
    draw_errors(report, results)
    draw_surfaces(meshes, topology, report, config, results)
    return {"surfaces": report, "edge": 2.0 / config.rows}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, CHART, *MESHES], arguments)


if __name__ == "__main__":
    sys.exit(main())
