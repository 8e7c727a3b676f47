r"""Paper Fig. 11: E per area of parallelogram stars inscribed in paraboloids, over the polar angle of an edge.

Edges p, q of a lattice in the x, y plane are lifted to the paraboloid ``z = alpha x^2 + beta y^2``. The four corners
``0, p, p + q, q`` of a face are coplanar if and only if p and q are conjugate, ``alpha p_x q_x + beta p_y q_y = 0``:
then the face is a planar parallelogram, as in the paper. So the polar angle of p determines the direction of q, and
faces are rectangles where the angle is a multiple of 90 degrees. With ``H = diag(alpha, beta)``, E per area of small
stars is ``2 (|p| |H q| + |q| |H p|) / |p x q|``, whatever the lengths of p and q, and never below
``|k1| + |k2| = 2 |alpha| + 2 |beta|``:

* alpha beta > 0: equal to it at every angle. E does not depend on the meshing.
* alpha beta < 0: equal to it at multiples of 90 degrees only, infinite in the asymptotic directions.

Parallelograms of a fixed shape that is turned are not planar. Cut along the better diagonal, they never do better.
Left whole, with the normals of their area vectors, they can reach ``|k1| + |k2|`` at other angles, squares for
``alpha = -beta`` even at all angles: E does not see the twist inside a face, so it ranks meshes of planar faces only.
All values are measured with :func:`torchfair.energies.normal_variation` on actual stars.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from _charts import BLUE, DASHES, GREEN, GREY, ORANGE, PURPLE, RED, add_chart, add_legend, label
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation
from torchfair.geometry import face_areas, planarity
from torchfair.viewing import ViewDirection, picture_edges
from torchfair.viewing.sheet import FAINT_TEXT, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME = "fig11_energy_per_area"
CHART, MESHES_PICTURE = "energy_per_area.png", "meshes.png"
MESHES = ("saddle_rectangles.obj", "saddle_parallelograms.obj", "bowl_rectangles.obj", "bowl_parallelograms.obj")
DOUBLE = torch.float64

PLANAR = "planar parallelograms"
# Shapes that are turned: the second edge relative to the first, its length and its angle in degrees.
SHAPES = {"squares, cut": (1.0, 90.0), "rectangles 2:1, cut": (2.0, 90.0), "rhombi of 60°, cut": (1.0, 60.0)}
TWISTED = "squares, whole but twisted"
SIGNS = {"saddle": "αβ < 0", "bowl": "αβ > 0"}
STYLES = {
    PLANAR: (BLUE, "-", 2.6),
    "squares, cut": (ORANGE, "-", 1.6),
    "rectangles 2:1, cut": (RED, "-", 1.6),
    "rhombi of 60°, cut": (PURPLE, "-", 1.6),
    TWISTED: (GREEN, DASHES, 1.6),
}


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    alpha: float = setting(1.0, "coefficient of x^2")
    beta: float = setting(0.6, "coefficient of y^2, in absolute value; both signs are tried")
    size: float = setting(0.01, "edge length of the stars, in the unit of 1 / alpha", least=1e-4)
    steps: int = setting(180, "polar angles between 0 and 180 degrees", least=4)
    angle: float = setting(20.0, "polar angle of the drawn parallelograms, degrees")
    cells: int = setting(8, "cells along the drawn meshes", least=2)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.alpha > 0 and self.beta > 0):
            raise ValueError("alpha and beta must be positive: the sign of beta is changed by the experiment")


# ---- stars ---------------------------------------------------------------------------------------------


def star_topology(cut: bool) -> Topology:
    """Four faces around vertex 4 of a 3 x 3 lattice; ``cut``: by the diagonals parallel to p + q."""
    corners = torch.tensor([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    return Topology.from_faces(torch.cat([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]) if cut else corners)


def lattice(p: Tensor, q: Tensor, coefficients: Tensor, reach: int = 1) -> Tensor:
    """Lattice points ``i p + j q``, ``|i|, |j| <= reach``, on the paraboloid: (*batch, (2 reach + 1)^2, 3)."""
    steps = torch.arange(-reach, reach + 1, dtype=p.dtype)
    j, i = torch.meshgrid(steps, steps, indexing="ij")
    plane = i.reshape(-1, 1) * p[..., None, :] + j.reshape(-1, 1) * q[..., None, :]
    return torch.cat([plane, (plane**2 @ coefficients)[..., None]], dim=-1)


def energy_per_area(p: Tensor, q: Tensor, coefficients: Tensor, *, cut: bool = False) -> Tensor:
    """E per area (*batch,) around the middle vertex of a star.

    A vertex has half of each of its edges, and one cell, a quarter of the area of the four cells around it.
    """
    topology = star_topology(cut)
    vertices = lattice(p, q, coefficients)
    share = 0.5 * (topology.interior_edges == 4).any(1).to(p.dtype)
    return normal_variation(vertices, topology, share) / (0.25 * face_areas(vertices, topology).sum(-1))


def directions(angles: Tensor) -> Tensor:
    """Unit vectors (*batch, 2) at polar angles in radians."""
    return torch.stack([angles.cos(), angles.sin()], dim=-1)


def conjugate(p: Tensor, coefficients: Tensor) -> Tensor:
    """The conjugate direction, to the left of p: unit q with ``p.(H q) = 0``."""
    normal = coefficients * p
    q: Tensor = torch.stack([-normal[..., 1], normal[..., 0]], dim=-1)
    q = q / torch.linalg.vector_norm(q, dim=-1, keepdim=True)
    left = p[..., :1] * q[..., 1:] - p[..., 1:] * q[..., :1] >= 0
    return torch.where(left, q, -q)


def closed_form(p: Tensor, q: Tensor, coefficients: Tensor) -> Tensor:
    """E per area of an infinitesimal star with planar faces."""
    cross = (p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]).abs()
    sizes = [torch.linalg.vector_norm(x, dim=-1) for x in (p, coefficients * q, q, coefficients * p)]
    value: Tensor = 2 * (sizes[0] * sizes[1] + sizes[2] * sizes[3]) / cross
    return value


def curves(config: Config, coefficients: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
    """Polar angles in degrees, and E per area over ``|k1| + |k2|`` of every kind of star."""
    degrees = torch.linspace(0, 180, config.steps + 1, dtype=DOUBLE)
    smooth = 2 * coefficients.abs().sum()
    p = config.size / config.alpha * directions(degrees.deg2rad())
    values = {PLANAR: energy_per_area(p, _conjugate_edge(p, coefficients), coefficients)}
    for name, (length, angle) in SHAPES.items():
        q = length * config.size / config.alpha * directions((degrees + angle).deg2rad())
        # The other diagonal of the cells is that of the lattice of p and -q.
        both = [energy_per_area(p, side, coefficients, cut=True) for side in (q, -q)]
        values[name] = torch.minimum(*both)
    square = torch.stack([-p[..., 1], p[..., 0]], dim=-1)
    values[TWISTED] = energy_per_area(p, square, coefficients)
    return degrees, {name: value / smooth for name, value in values.items()}


def _conjugate_edge(p: Tensor, coefficients: Tensor) -> Tensor:
    length: Tensor = torch.linalg.vector_norm(p, dim=-1, keepdim=True)
    return length * conjugate(p, coefficients)


def measure(config: Config, coefficients: Tensor) -> Report:
    """The curves, and what the paper says about them."""
    degrees, values = curves(config, coefficients)
    p = config.size / config.alpha * directions(degrees.deg2rad())
    q = _conjugate_edge(p, coefficients)
    formula = closed_form(p, q, coefficients) / (2 * coefficients.abs().sum())
    usable = formula < 10  # farther than that the parallelograms are slivers
    planar, off = values[PLANAR][usable], (degrees[usable] + 45) % 90 - 45
    longer = energy_per_area(p, 3 * q, coefficients)[usable] / (2 * coefficients.abs().sum())
    return {
        "coefficients": coefficients,
        "absolute_curvature": 2 * coefficients.abs().sum(),
        "polar_angle_degrees": degrees,
        "ratio": {name: torch.where(usable, v, torch.nan) if name == PLANAR else v for name, v in values.items()},
        "smallest_planar": planar.min(),
        "smallest_planar_at_degrees": degrees[usable][planar.argmin()],
        "smallest_planar_10_degrees_away": planar[off.abs() >= 10].min(),
        "largest_planar_below_10": planar.max(),
        "smallest_cut": {name: values[name].min() for name in SHAPES},
        "largest_deviation_from_formula": (planar / formula[usable] - 1).abs().max(),
        "largest_influence_of_length": (longer / planar - 1).abs().max(),
        "largest_planarity": planarity(lattice(p, q, coefficients), star_topology(False))[usable].max(),
    }


# ---- pictures ------------------------------------------------------------------------------------------


def drawn_mesh(config: Config, coefficients: Tensor, angle: float) -> tuple[Tensor, Topology]:
    """A patch of planar parallelograms whose cells cover equal areas of the plane at all angles."""
    p = directions(torch.tensor(math.radians(angle), dtype=DOUBLE))
    q = conjugate(p, coefficients)
    cell = 1.0 / (config.alpha * config.cells)
    scale = cell / (p[0] * q[1] - p[1] * q[0]).abs().sqrt()
    reach = (config.cells + 1) // 2
    index = torch.arange((2 * reach + 1) ** 2).view(2 * reach + 1, -1)
    faces = torch.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], dim=-1).reshape(-1, 4)
    return lattice(scale * p, scale * q, coefficients, reach), Topology.from_faces(faces)


def draw_meshes(config: Config, signs: dict[str, Tensor], results: Results) -> None:
    """Rectangles and parallelograms on the saddle and in the bowl."""
    meshes = {
        f"{SIGNS[sign]}, {angle:g}°": drawn_mesh(config, coefficients, angle)
        for sign, coefficients in signs.items()
        for angle in (0.0, config.angle)
    }
    for file, (vertices, topology) in zip(MESHES, meshes.values(), strict=True):
        results.mesh(file, vertices, topology)
    view = ViewDirection(torch.tensor([-0.6, -0.9, 1.0]), torch.tensor([0.0, 0, 1]))
    picture_edges(
        results.path(MESHES_PICTURE),
        {name: vertices for name, (vertices, _) in meshes.items()},
        [topology for _, topology in meshes.values()],
        view=view,
        width=config.width,
        overwrite=results.force,
    )


def draw_curves(measured: dict[str, Report], results: Results) -> None:
    """Energy per area over the polar angle, a chart for each sign of the Gauss curvature."""
    sheet = Sheet(1600, 770)
    for column, (sign, report) in enumerate(measured.items()):
        a, b = report["coefficients"].tolist()
        title = f"${SIGNS[sign].replace(' ', '')}$:  $z = {'' if a == 1 else f'{a:g} '}x^2 {b:+g}\\,y^2$"
        words = r"$E$ per area  /  $(|\kappa_1|+|\kappa_2|)$" if column == 0 else ""
        axes = add_chart(
            sheet, 110 + column * 760, 160, 690, 490, title=title, x="polar angle of an edge", y=words
        )  # fmt: skip
        draw_ratios(axes, report)
        if column == 0:
            add_legend(sheet.figure, handles=axes.get_lines()[: len(STYLES)], loc="upper center", ncols=3)
        else:
            label(axes, "all curves but one lie on 1", 90, 1.06, FAINT_TEXT, ha="center", va="bottom")
    sheet.write(results.path(CHART), overwrite=results.force)


def draw_ratios(axes: Axes, report: Report) -> None:
    """The curves of one paraboloid, and its asymptotic directions."""
    for name, ratio in report["ratio"].items():
        color, line, width = STYLES[name]
        axes.plot(report["polar_angle_degrees"], ratio, color=color, linestyle=line, linewidth=width, label=name)
    a, b = report["coefficients"].tolist()
    if a * b < 0:
        asymptotic = math.degrees(math.atan(math.sqrt(-a / b)))
        for angle in (asymptotic, 180 - asymptotic):
            axes.axvline(angle, color=GREY, linewidth=1.0, linestyle=DASHES)
            label(axes, "asymptotic", angle - 1.5, 2.95, FAINT_TEXT, rotation=90, ha="right", va="top")
    axes.set(xlim=(0, 180), ylim=(0.8, 3))
    axes.set_xticks(range(0, 181, 30), [f"{angle}°" for angle in range(0, 181, 30)])


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Measures, draws, and prints what came out."""
    signs = {
        "saddle": torch.tensor([config.alpha, -config.beta], dtype=DOUBLE),
        "bowl": torch.tensor([config.alpha, config.beta], dtype=DOUBLE),
    }
    measured = {sign: measure(config, coefficients) for sign, coefficients in signs.items()}
    for sign, report in measured.items():
        print(
            f"{sign}: planar parallelograms have at least {report['smallest_planar']:.4f} (|k1| + |k2|), reached at "
            f"{report['smallest_planar_at_degrees']:g} degrees; {report['smallest_planar_10_degrees_away']:.4f} and "
            "more from 10 degrees away from the axes on"
        )
    draw_curves(measured, results)
    draw_meshes(config, signs, results)
    return dict(measured)


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [CHART, MESHES_PICTURE, *MESHES], arguments)


if __name__ == "__main__":
    sys.exit(main())
