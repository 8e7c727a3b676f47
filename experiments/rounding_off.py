r"""Paper section 4: a mesh rounded off with cylinders along its edges is a smooth surface with C about E.

The argument is correct as far as it goes, and easily leads to a wrong conclusion. A triangle mesh P inscribed in the
graph Phi of a function is the graph of a piecewise linear function. Averaged with a smooth weight on a square of half
width ``rho`` that becomes the graph Psi of a smooth function: away from the vertices of P a cylinder surface along
every edge, near them small smooth pieces. C(Psi) is integrated over a window inside the mesh; E and E' of P count the
edges as far as they lie in the window, C(Phi) is that of the graph in it.

* As ``rho`` goes to 0, C(Psi) goes to E'(P), which is E(P) but for the difference of angle and sine.
* That does not make E(P) an approximation of C(Phi): only where ``rho`` is larger than the edges, so that they are
  averaged out, C(Psi) comes to C(Phi), and on saddles that is less for all meshes but principal ones.

Where the graph is a bowl both limits come near each other, and agree for convex meshes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from _charts import BLUE, GREEN, GREY, ORANGE, RED, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from scipy.ndimage import convolve1d
from torch import Tensor

from torchfair import Topology, TorchfairError
from torchfair.energies import total_absolute_curvature
from torchfair.geometry import dihedral_angles, dual_edge_lengths, edge_lengths, nuclear_norms
from torchfair.shapes import (
    Paraboloid,
    PrincipalParaboloid,
    ShapeMesh,
    irregular_triangles,
    parameter_quads,
    principal_quads,
    rotated_lattice,
)
from torchfair.triangulation import triangulate
from torchfair.viewing.sheet import Sheet

NAME = "rounding_off"
CHART = "rounding_off.png"
Array = npt.NDArray[np.float64]
HALF = 0.5  # of the window
MARGIN = 2.1  # the patch is so many times as wide
LAYOUTS = {"principal quads, cut": BLUE, "squares, cut": GREEN, "turned lattice": ORANGE, "irregular": RED}
SURFACES = {"saddle": -1.0, "bowl": 1.0}
_POWER = 5  # of 1 - t^2, the weight of the average


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    alpha: float = setting(0.6, "curvature along x; along y it is half of that, of either sign", least=0.05)
    rows: int = setting(14, "edges along the patch, about", least=6)
    radii: tuple[float, ...] = setting(
        (2.0, 1.0, 0.5, 0.25, 0.12, 0.06), "half widths of the average, in mean edges", least=0.01
    )
    samples: int = setting(8, "samples along the half width of the average", least=3)


# ---- what is measured ----------------------------------------------------------------------------------


def layouts(a: float, b: float, rows: int, seed: int) -> dict[str, ShapeMesh]:
    """Meshes of one graph, larger than the window by the largest average."""
    width = MARGIN * HALF
    plain, principal = (kind(a, b, (width, width)) for kind in (Paraboloid, PrincipalParaboloid))
    return {
        "principal quads, cut": principal_quads(principal, rows, rows),
        "squares, cut": parameter_quads(plain, rows, rows),
        "turned lattice": rotated_lattice(plain, rows, rows, 0.4),
        "irregular": irregular_triangles(plain, rows * rows, seed=seed),
    }


def heights(vertices: Tensor, topology: Topology, grid: Array) -> Array:
    """The piecewise linear function of a triangle mesh on the points ``grid x grid``."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    x, y, z = vertices.numpy().T
    found = LinearTriInterpolator(Triangulation(x, y, topology.corners.view(-1, 3).numpy()), z)
    result = found(*np.meshgrid(grid, grid, indexing="ij"))
    if np.ma.is_masked(result):
        raise TorchfairError("the mesh does not cover the window and the average around it: make radii smaller")
    return np.asarray(result, dtype=float)


def kernels(samples: int, spacing: float) -> tuple[Array, Array, Array]:
    """A smooth weight on ``2 samples + 1`` points with sum 1, and those that give first and second derivatives."""
    t = np.linspace(-1, 1, 2 * samples + 1)
    bump = (1 - t**2) ** _POWER
    weight = bump / bump.sum()
    # Exact on polynomials of the second degree, since moments are corrected.
    first = t * (1 - t**2) ** (_POWER - 1)
    first /= (first * t * samples * spacing).sum()
    second = ((2 * _POWER - 1) * t**2 - 1) * (1 - t**2) ** (_POWER - 2)
    second -= weight * second.sum()
    second /= (second * (t * samples * spacing) ** 2 / 2).sum()
    return weight, first, second


def curvature_of_graph(z: Array, samples: int, spacing: float) -> float:
    """Integral of |k1| + |k2| over the graph of averaged heights, as far as averages are complete."""
    weight, first, second = kernels(samples, spacing)

    def averaged(along: Array, across: Array) -> Tensor:
        whole = convolve1d(convolve1d(z, along[::-1], axis=0), across[::-1], axis=1)
        return torch.from_numpy(whole[samples:-samples, samples:-samples].copy())

    slopes = averaged(first, weight), averaged(weight, first)
    bends = averaged(second, weight), averaged(first, first), averaged(weight, second)
    return float(_density(slopes, bends).mean()) * (2 * HALF) ** 2


def _density(slopes: tuple[Tensor, Tensor], bends: tuple[Tensor, Tensor, Tensor]) -> Tensor:
    """|k1| + |k2| of a graph times its area element."""
    (p, q), (r, s, t) = slopes, bends
    root = (1 + p * p + q * q).sqrt()
    # The second fundamental form in the orthonormal frame of the gradient and its normal.
    steep = (p * p + q * q).sqrt()
    known = steep > 1e-12
    c, d = (torch.where(known, part / torch.where(known, steep, 1.0), other) for part, other in ((p, 1.0), (q, 0.0)))
    along = (c * c * r + 2 * c * d * s + d * d * t) / root**3
    mixed = (c * d * (t - r) + (c * c - d * d) * s) / root**2
    across = (d * d * r - 2 * c * d * s + c * c * t) / root
    matrices = torch.stack([torch.stack([along, mixed], -1), torch.stack([mixed, across], -1)], -2)
    norms: Tensor = nuclear_norms(matrices) * root
    return norms


def in_window(vertices: Tensor, topology: Topology) -> Tensor:
    """(I,) lengths of interior edges as far as they lie above the window."""
    start, stop = vertices[topology.interior_edges].unbind(1)
    step = stop - start
    near, far = torch.zeros_like(step[:, 0]), torch.ones_like(step[:, 0])
    for axis in (0, 1):
        moves = step[:, axis].abs() > 1e-14
        speed = torch.where(moves, step[:, axis], 1.0)
        ends = torch.stack([(-HALF - start[:, axis]) / speed, (HALF - start[:, axis]) / speed])
        inside = (start[:, axis].abs() <= HALF).to(step)
        near = torch.maximum(near, torch.where(moves, ends.amin(0), 1 - inside))
        far = torch.minimum(far, torch.where(moves, ends.amax(0), inside))
    return (far - near).clamp_min(0) * torch.linalg.vector_norm(step, dim=1)


def measure(config: Config, b: float) -> Report:
    """All layouts of one graph."""
    exact = Paraboloid(config.alpha, b, (HALF, HALF)).total_absolute_curvature()
    report: Report = {"coefficients": (config.alpha, b), "curvature_of_surface": exact, "layouts": {}}
    for name, mesh in layouts(config.alpha, b, config.rows, config.seed).items():
        vertices = mesh.vertices
        topology = Topology.from_faces(triangulate(vertices, mesh.topology).triangles, len(vertices))
        lengths = in_window(vertices, topology)
        edge = float(edge_lengths(vertices, topology).mean())
        angles = float((lengths * dihedral_angles(vertices, topology).abs()).sum())
        rounded = []
        for radius in config.radii:
            spacing = radius * edge / config.samples
            count = round(2 * HALF / spacing)
            spacing = 2 * HALF / count
            cells = np.arange(count + 2 * config.samples, dtype=np.float64)
            grid: Array = -HALF + spacing * (cells - config.samples + 0.5)
            rounded.append(curvature_of_graph(heights(vertices, topology, grid), config.samples, spacing))
        report["layouts"][name] = {
            "mean_edge_length": edge,
            "normal_variation": float((lengths * dual_edge_lengths(vertices, topology)).sum()),
            "angle_variation": angles,
            "total_absolute_curvature": float(total_absolute_curvature(vertices, topology)),
            "rounded": rounded,
            "rounded_over_energy": [value / angles for value in rounded],
            "rounded_over_surface": [value / exact for value in rounded],
            "energy_over_surface": angles / exact,
        }
    return report


# ---- pictures ------------------------------------------------------------------------------------------


def draw(config: Config, measured: dict[str, Report], results: Results) -> None:
    """C of the rounded mesh over that of the surface, against the radius."""
    sheet = Sheet(1600, 770)
    for column, (sign, report) in enumerate(measured.items()):
        a, b = report["coefficients"]
        title = f"{sign}:  $z = ({a:g}\\,x^2 {b:+g}\\,y^2)/2$"
        words = r"$C(\Psi)\;/\;C(\Phi)$" if column == 0 else ""
        axes = add_chart(sheet, 110 + column * 760, 160, 690, 490, title=title, x=r"$\rho$ / mean edge", y=words)
        for name, row in report["layouts"].items():
            axes.plot(config.radii, row["rounded_over_surface"], color=LAYOUTS[name], marker="o", label=name)
            axes.axhline(row["energy_over_surface"], color=LAYOUTS[name], linewidth=1.0, linestyle=(0, (2, 3)))
        axes.axhline(1.0, color=GREY, linewidth=1.0)
        axes.set_xscale("log")
        axes.set_xticks(config.radii, [f"{radius:g}" for radius in config.radii])
        axes.minorticks_off()
        axes.set(ylim=(0.9, 1.45))
        if column == 0:
            add_legend(sheet.figure, handles=axes.get_lines()[: 2 * len(LAYOUTS) : 2], loc="upper center", ncols=4)
    sheet.write(results.path(CHART), overwrite=results.force)


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Measures, draws, and prints what came out."""
    measured = {name: measure(config, 0.5 * sign * config.alpha) for name, sign in SURFACES.items()}
    for name, report in measured.items():
        for layout, row in report["layouts"].items():
            print(
                f"{name}, {layout}: E' = {row['energy_over_surface']:.3f} C; rounded C / E' = "
                + ", ".join(f"{value:.3f}" for value in row["rounded_over_energy"])
            )
    draw(config, measured, results)
    return {"radii": config.radii, **measured}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [CHART], arguments)


if __name__ == "__main__":
    sys.exit(main())
