"""Paper Fig. 7: E of ever finer principal meshes approaches C; that of other meshings does not.

Surfaces with principal curvature lines known exactly are meshed along these lines, finer and finer, and in other
ways: triangles on the half-shifted lattice of principal lines, lattices turned against them, irregular triangles.
E of principal quads converges to the total absolute curvature C of the surface, with order two when compared with
C of the region that the interior edges stand for (boundary edges carry no energy). Where a curvature changes its sign,
the constant of that order wobbles with the position of the edges beside the sign change. Cutting every principal quad
by a diagonal changes nothing in the limit. All other meshings keep a larger E, however fine they are.

The first surface is drawn: (a) to (c) principal meshes, (d) irregular triangles, edges coloured by l |a|.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from _charts import BLUE, DASHES, GREEN, GREY, ORANGE, PURPLE, RED, add_chart, add_legend, label
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology, shapes
from torchfair.energies import normal_variation
from torchfair.geometry import edge_lengths
from torchfair.shapes.rotated_lattice import metric_scale
from torchfair.viewing import ViewDirection, picture_edges
from torchfair.viewing.sheet import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Mesh = tuple[Tensor, Topology]
NAME = "fig07_principal_meshes"
EDGES, CHART = "edges.png", "convergence.png"
VIEW = ViewDirection(torch.tensor([-0.5, -0.75, 1.1]), torch.tensor([0.0, 0, 1]))
MESHES = ("principal_coarse.obj", "principal_middle.obj", "principal_fine.obj", "irregular.obj")


@dataclass(frozen=True)
class Moulding(shapes.Surface):
    """Free-form roof on which parameter lines are principal: a profile moved along a plane curve, its spine.

    The plane of the profile stays orthogonal to the spine ``(u, swing sin(u))`` and vertical, so profiles and the
    curves orthogonal to them are principal (a moulding surface). K has both signs, because spine and profile
    ``z = rise cos(v)`` have inflections.
    """

    swing: float = 0.3
    rise: float = 0.7

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Along the spine, and horizontally across it."""
        return ((-3.0, 3.0), (-2.0, 2.0))

    @property
    def parameter_lines_are_principal(self) -> bool:
        """Always true."""
        return True

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        """Points ``(..., 3)``."""
        slope = self.swing * u.cos()
        across = v / (1 + slope**2).sqrt()
        return torch.stack([u - slope * across, self.swing * u.sin() + across, self.rise * v.cos()], dim=-1)


SURFACES: dict[str, Callable[[], shapes.Surface]] = {
    "moulding": Moulding,
    "enneper": shapes.Enneper,
    "torus": shapes.Torus,
    "catenoid": shapes.Catenoid,
    "inner_torus": shapes.SURFACES["inner_torus"],
    "principal_helicoid": shapes.PrincipalHelicoid,
}
PRINCIPAL = "principal quads"
CUT = "principal quads, each cut"
MESHINGS = {
    PRINCIPAL: (BLUE, "o"),
    CUT: (GREEN, "s"),
    "principal triangles": (ORANGE, "^"),
    "turned triangles": (RED, "v"),
    "turned squares, each cut": (PURPLE, "D"),
    "irregular triangles": (GREY, "X"),
}


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    surfaces: tuple[str, ...] = setting(
        ("moulding", "enneper", "torus"), "surfaces to mesh; the first is drawn", choices=tuple(SURFACES)
    )
    rows: tuple[int, ...] = setting((8, 16, 32, 64), "rows of cells, coarse to fine; even, at least two", least=4)
    angle: float = setting(22.5, "degrees by which lattices are turned against the principal directions")
    drawn_rows: tuple[int, ...] = setting((6, 12, 24), "rows of the three drawn principal meshes", least=3)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.rows) < 2 or list(self.rows) != sorted(set(self.rows)) or any(n % 2 for n in self.rows):
            raise ValueError("rows must be at least two even numbers, ascending")
        if len(self.drawn_rows) != 3:
            raise ValueError("drawn_rows must be three numbers")


# ---- meshes --------------------------------------------------------------------------------------------


def square_cells(surface: shapes.Surface, rows: int) -> int:
    """The even number of columns that makes cells nearly square."""
    _, (width, height) = metric_scale(surface)
    return max(4, 2 * round(rows * width / height / 2))


def cut_quads(mesh: Mesh) -> Mesh:
    """Every quad cut by the diagonal from its first corner."""
    vertices, topology = mesh
    a, b, c, d = topology.corners.view(-1, 4).unbind(1)
    return vertices, Topology.from_faces(torch.cat([torch.stack([a, b, c], 1), torch.stack([a, c, d], 1)]))


def meshings(surface: shapes.Surface, rows: int, config: Config) -> dict[str, Mesh]:
    """All meshings of the surface with about the same number of vertices."""
    columns, angle = square_cells(surface, rows), float(np.deg2rad(config.angle))
    quads = shapes.principal_quads(surface, rows, columns)
    principal = (quads.vertices, quads.topology)
    others = {
        "principal triangles": shapes.principal_triangles(surface, rows, columns),
        "turned triangles": shapes.rotated_lattice(surface, rows, columns, angle),
        "turned squares, each cut": shapes.rotated_lattice(surface, rows, columns, angle, kind="split"),
        "irregular triangles": shapes.irregular_triangles(surface, len(quads.vertices), config.seed),
    }
    meshes = {PRINCIPAL: principal, CUT: cut_quads(principal)}
    return meshes | {name: (mesh.vertices, mesh.topology) for name, mesh in others.items()}


# ---- figures -------------------------------------------------------------------------------------------


def observed_order(edges: list[float], errors: list[float]) -> float:
    """Slope of log error over log edge length, by least squares."""
    return float(np.polyfit(np.log(edges), np.log(errors), 1)[0])


def measure(surface: shapes.Surface, config: Config) -> Report:
    """E of all meshings at all sizes, against C."""
    total = surface.total_absolute_curvature()
    table: dict[str, list[Report]] = {name: [] for name in MESHINGS}
    for rows in config.rows:
        inner = shapes.interior_absolute_curvature(surface, rows, square_cells(surface, rows))
        for name, (vertices, topology) in meshings(surface, rows, config).items():
            row: Report = {"rows": rows, "vertices": topology.num_vertices, "faces": topology.num_faces}
            row["mean_edge_length"] = float(edge_lengths(vertices, topology).mean())
            row["normal_variation"] = float(normal_variation(vertices, topology))
            row["ratio"] = row["normal_variation"] / total
            if name == PRINCIPAL:
                row["total_absolute_curvature_inside"] = inner
                row["error"] = abs(row["normal_variation"] - total) / total
                row["error_inside"] = abs(row["normal_variation"] - inner) / inner
            table[name].append(row)
    principal = table[PRINCIPAL]
    steps = [row["mean_edge_length"] for row in principal]
    others = {name: rows[-1]["ratio"] for name, rows in table.items() if name not in (PRINCIPAL, CUT)}
    return {
        "total_absolute_curvature": total,
        "area": surface.area(),
        "order": observed_order(steps, [row["error"] for row in principal]),
        "order_inside": observed_order(steps, [row["error_inside"] for row in principal]),
        "finest_ratio_principal": principal[-1]["ratio"],
        "finest_ratio_principal_cut": table[CUT][-1]["ratio"],
        "finest_ratio_others": others,
        "smallest_ratio_others": min(others.values()),
        "meshings": table,
    }


# ---- pictures ------------------------------------------------------------------------------------------


def draw_edges(surface: shapes.Surface, config: Config, results: Results, total: float) -> None:
    """Fig. 7 (a) to (d), and the meshes in it."""
    meshes: dict[str, Mesh] = {}
    for letter, rows in zip("abc", config.drawn_rows, strict=True):
        mesh = shapes.principal_quads(surface, rows, square_cells(surface, rows))
        meshes[f"({letter})"] = (mesh.vertices, mesh.topology)
    irregular = shapes.irregular_triangles(surface, max(60, len(meshes["(b)"][0])), config.seed)
    meshes["(d)"] = (irregular.vertices, irregular.topology)
    for file, (vertices, topology) in zip(MESHES, meshes.values(), strict=True):
        results.mesh(file, vertices, topology)
    picture_edges(
        results.path(EDGES),
        {name: vertices for name, (vertices, _) in meshes.items()},
        [topology for _, topology in meshes.values()],
        f"Principal quads, finer and finer, and irregular triangles: C = {total:.4g}",
        view=VIEW if isinstance(surface, Moulding) else None,
        width=config.width,
        overwrite=results.force,
    )


def draw_convergence(measured: dict[str, Report], results: Results) -> None:
    """Left E / C of every meshing over the edge length, right the error of principal quads; a row per surface."""
    height, gap, head = 430, 150, 170
    sheet = Sheet(1600, head + len(measured) * (height + gap) - 30)
    for number, (name, report) in enumerate(measured.items()):
        top = head + number * (height + gap)
        title = f"{name.replace('_', ' ')}: $C$ = {report['total_absolute_curvature']:.4g}"
        left = add_chart(sheet, 120, top, 800, height, title=title, x="mean edge length", y="$E\\,/\\,C$")
        draw_ratios(left, report)
        right = add_chart(
            sheet, 1090, top, 470, height, title="principal quads", x="mean edge length", y="relative error of $E$"
        )
        draw_errors(right, report)
        if number == 0:
            add_legend(sheet.figure, handles=left.get_lines()[:-1], loc="upper center", ncols=3)
    sheet.write(results.path(CHART), overwrite=results.force)


def draw_ratios(axes: Axes, report: Report) -> None:
    """E / C of every meshing."""
    for meshing, rows in report["meshings"].items():
        color, marker = MESHINGS[meshing]
        steps, ratios = [row["mean_edge_length"] for row in rows], [row["ratio"] for row in rows]
        axes.plot(steps, ratios, color=color, marker=marker, markersize=6, linewidth=1.8, label=meshing)
    axes.axhline(1, color=GREY, linewidth=1.2, linestyle=DASHES)
    axes.set_xscale("log")
    mark_steps(axes, report)


def draw_errors(axes: Axes, report: Report) -> None:
    """Relative errors against C of the whole surface and of the region inside, with the slope of order two."""
    rows = report["meshings"][PRINCIPAL]
    steps, inside, whole = np.array([[row[k] for k in ("mean_edge_length", "error_inside", "error")] for row in rows]).T
    style = {"markersize": 6, "linewidth": 1.8}
    words = f"against $C$: order {report['order']:.2f}"
    axes.loglog(steps, whole, color=ORANGE, marker="s", label=words, **style)
    if not np.allclose(inside, whole):
        words = f"$C$ less half a cell: order {report['order_inside']:.2f}"
        axes.loglog(steps, inside, color=BLUE, marker="o", label=words, **style)
    slope = 0.3 * inside[-1] * (steps / steps[-1]) ** 2
    axes.loglog(steps, slope, color=GREY, linewidth=1.2, linestyle=DASHES)
    label(axes, "order 2", float(steps[0]), 0.3 * float(slope[0]), GREY, ha="right", va="top")
    low, high = axes.get_ylim()
    axes.set_ylim(0.6 * low, high * (high / low) ** 0.35)
    mark_steps(axes, report)
    add_legend(axes, loc="upper left")


def mark_steps(axes: Axes, report: Report) -> None:
    """Marks the edge lengths of the principal meshes, as plain numbers."""
    steps = [row["mean_edge_length"] for row in report["meshings"][PRINCIPAL]]
    axes.set_xticks(steps, [f"{step:.2g}" for step in steps])
    axes.minorticks_off()


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Measures, draws, and prints what came out."""
    measured = {}
    for name in config.surfaces:
        report = measured[name] = measure(SURFACES[name](), config)
        print(
            f"{name}: C = {report['total_absolute_curvature']:.6g}, E/C of principal quads "
            f"{report['finest_ratio_principal']:.4f} (order {report['order_inside']:.2f} against C inside), "
            f"of the others {report['smallest_ratio_others']:.3f} and more"
        )
    first = config.surfaces[0]
    draw_edges(SURFACES[first](), config, results, measured[first]["total_absolute_curvature"])
    draw_convergence(measured, results)
    return {"surfaces": measured}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [EDGES, CHART, *MESHES], arguments)


if __name__ == "__main__":
    sys.exit(main())
