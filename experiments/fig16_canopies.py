"""Paper Figs. 1, 10, 16 and 21: canopies of least total absolute curvature C, given by their boundary curves alone.

Three roofs: a vault over a square with a parabolic arch on each side; a leaf over an ellipse whose rim rises and falls
four times; a star with five wings around a circular opening. Curvature in colours, flat parts white: the surfaces of
least C consist of flat and singly curved parts that meet in curved ridges, which neither the minimal-area surfaces nor
those of least squared curvature (same meshes, same starts) show.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _forms import LEAST, circle, closed_curve, compare, mesh_files, polygon, save_meshes, table_line
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.energies import total_absolute_curvature_per_vertex
from torchfair.formfinding import start_surface
from torchfair.geometry import vertex_areas
from torchfair.viewing import picture_curvature

NAME = "fig16_canopies"
ALL = "least_c.png"


def star(angle: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Five wings that rise at their tips."""
    radius, wave = 2.0 + 0.15 * (5 * angle).cos(), (5 * angle).cos()
    return radius * angle.cos(), radius * angle.sin(), 0.3 * wave


CANOPIES: dict[str, list[ClosedCurve]] = {
    "vault": [polygon([(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (1.0, -1.0, 0.0)], rise=0.6)],
    "leaf": [closed_curve(lambda a: (1.5 * a.cos(), a.sin(), 0.4 * (4 * a).cos()))],
    "star": [closed_curve(star), circle(0.7, 0.9)],
}


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    canopies: tuple[str, ...] = setting(tuple(CANOPIES), "roofs", choices=tuple(CANOPIES))
    vertices: int = setting(600, "vertices of each start, about", least=40)
    levels: int = setting(1, "how often meshes are refined", least=0)
    iterations: int = setting(60, "most steps towards the surfaces to compare with", least=1)


def concentration(vertices: Tensor, topology: Topology) -> float:
    """Share of the area, the most curved first, that holds half of C: small where curvature gathers in ridges."""
    stars = total_absolute_curvature_per_vertex(vertices, topology, boundary="extrapolated")
    areas = vertex_areas(vertices, topology)
    order = (stars / areas).argsort(descending=True)
    half = int(torch.searchsorted(stars[order].cumsum(0), 0.5 * stars.sum()))
    return float(areas[order[: half + 1]].sum() / areas.sum())


def measure(name: str, config: Config, results: Results) -> tuple[Tensor, Topology, Report]:
    """One canopy: surfaces, figures, picture."""
    curves = CANOPIES[name]
    surfaces, topology, report = compare(
        start_surface(curves, config.vertices), curves, config.levels, config.iterations
    )
    for kind, surface in surfaces.items():
        report["surfaces"][kind]["area_with_half_of_c"] = concentration(surface, topology)
    save_meshes(results, surfaces, topology, name)
    picture_curvature(
        results.path(f"{name}.png"),
        [(kind, surface, topology) for kind, surface in surfaces.items()],
        name,
        width=config.width,
        overwrite=results.force,
    )
    print(table_line(name, report))
    return surfaces[LEAST], topology, report


def experiment(config: Config, results: Results) -> Report:
    """All canopies, and one picture of them together."""
    reports, least = {}, []
    for name in config.canopies:
        vertices, topology, reports[name] = measure(name, config, results)
        least.append((name, vertices, topology))
    picture_curvature(results.path(ALL), least, width=config.width, overwrite=results.force)
    return {"canopies": reports}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [ALL, *(file for name in CANOPIES for file in (f"{name}.png", *mesh_files(name)))]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
