"""Paper Fig. 15: surfaces of least total absolute curvature C whose boundary and tangent planes there are prescribed.

Patches of a cylinder and of a cone are to be given back: their boundary and their normals along it are prescribed, the
start bulges. Two designs follow. *Rosette*: a circle whose tangent planes tilt up and down three times around it.
*Pipe*: between two circles, tangent planes horizontal along the wide lower one and vertical along the narrow upper one;
a plate and a cylinder meet these in a ridge, where C = 2 pi h + pi^2 r in the limit. The discrete C counts sin a of an
edge, so a ridge that is sharp costs less there, 2 pi h + 2 pi r. Both are also drawn without prescribed tangent planes.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _forms import circle, figures, solve
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.energies import total_absolute_curvature
from torchfair.formfinding import FormSettings, prescribed_normals, start_surface
from torchfair.viewing import picture_curvature

NAME = "fig15_tangent_planes"
PATCHES = {"cylinder": 0.0, "cone": 0.35}  # how much the radius falls, of 1, over a length of 1
DESIGNS = ("rosette", "pipe")
KINDS = ("free", "prescribed")
RIM = circle(1.0, 0.0)
FOOT = circle(1.5, 0.0)
NECK = circle(0.6, 0.8)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    vertices: int = setting(500, "vertices of each start, about", least=40)
    levels: int = setting(1, "how often meshes are refined", least=0)
    bulge: float = setting(0.15, "how far the starts of the patches bulge", least=0)
    opening: float = setting(120.0, "degrees of the patches around their axis", least=10)
    tilt: float = setting(30.0, "degrees by which tangent planes of the rosette tilt", least=0)
    tangent_weight: float = setting(1e4, "weight of tangent planes of the designs", least=0)
    designs: tuple[str, ...] = setting(DESIGNS, "designs", choices=DESIGNS)


# ---- patches -------------------------------------------------------------------------------------------


def lattice(rows: int, columns: int) -> tuple[Tensor, Topology]:
    """Staggered triangles in the unit square: (V, 2), topology. Both side edges are straight."""
    places, faces = [], []
    for row in range(rows + 1):
        inner = (torch.arange(columns + 1, dtype=torch.float64) / columns).tolist()
        across = inner if row % 2 == 0 else [0.0, *(x + 0.5 / columns for x in inner[:-1]), 1.0]
        places.append(torch.tensor([[x, row / rows] for x in across], dtype=torch.float64))
    first = 0
    for row in range(rows):
        here, above = len(places[row]), len(places[row + 1])
        a, b = first, first + here
        if row % 2 == 0:
            faces += [[a + i, a + i + 1, b + i + 1] for i in range(here - 1)]
            faces += [[a + i, b + i + 1, b + i] for i in range(here)]
        else:
            faces += [[a + i, a + i + 1, b + i] for i in range(here - 1)]
            faces += [[a + i + 1, b + i + 1, b + i] for i in range(above - 1)]
        first += here
    return torch.cat(places), Topology.from_faces(torch.tensor(faces))


def patch(slope: float, config: Config) -> tuple[Tensor, Tensor, Topology]:
    """Exact patch and its outward normals (V, 3), topology."""
    opening = math.radians(config.opening)
    rows = max(2, 2 * round(0.5 * math.sqrt(config.vertices * 1.15 / opening)))
    uv, topology = lattice(rows, max(3, round(config.vertices / rows)))
    angle, height = opening * (uv[:, 0] - 0.5), uv[:, 1]
    out = torch.stack([angle.cos(), angle.sin(), torch.zeros_like(angle)], 1)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    places = (1.0 - slope * height)[:, None] * out + height[:, None] * up
    return places, (out + slope * up) / math.hypot(1.0, slope), topology


def recover(slope: float, config: Config) -> tuple[list[tuple[str, Tensor, Topology]], Report]:
    """Boundary and normals of a patch, a start that bulges, and what comes back."""
    exact, normals, topology = patch(slope, config)
    reach = (exact - exact.mean(0)).norm(dim=1).max()
    across = torch.atan2(exact[:, 1], exact[:, 0]) / math.radians(config.opening) + 0.5
    bump = (math.pi * across).sin() * (math.pi * exact[:, 2]).sin()
    start = exact + config.bulge * bump[:, None] * normals
    along = torch.where(topology.is_boundary_vertex[:, None], normals, torch.zeros_like(normals))
    found, report = solve(start, topology, normals=along, levels=config.levels)
    last = found.vertices
    radius = 1.0 - slope * last[:, 2]
    distance = (last[:, :2].norm(dim=1) - radius).abs() / math.hypot(1.0, slope)
    expected = math.radians(config.opening)  # times the height, 1: C of a full cone is 2 pi h
    rows = {"start": figures(start, topology), "found": figures(last, found.topology)}
    report |= {
        "vertices": len(last),
        "exact_absolute_curvature": expected,
        "excess": rows["found"]["total_absolute_curvature"] / expected - 1.0,
        "largest_distance": float(distance.max()),
        "largest_distance_relative": float(distance.max() / reach),
        "start_distance": float((start - exact).norm(dim=1).max()),
        "surfaces": rows,
    }
    return [("start", start, topology), ("found", last, found.topology)], report


# ---- designs -------------------------------------------------------------------------------------------


def conditions(name: str, config: Config) -> tuple[list[ClosedCurve], list[tuple[ClosedCurve, Tensor]]]:
    """Boundary curves, and those with tangent planes: each with normals (n, 3) at its knots."""
    curves = [RIM] if name == "rosette" else [FOOT, NECK]
    angle = 2.0 * math.pi * curves[-1].knots
    lean = math.radians(config.tilt) * (3 * angle).cos() if name == "rosette" else torch.full_like(angle, 0.5 * math.pi)
    leaning = torch.stack([lean.sin() * angle.cos(), lean.sin() * angle.sin(), lean.cos()], 1)
    if name == "rosette":
        return curves, [(RIM, leaning)]
    upright = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64).expand(len(FOOT.knots), 3)
    return curves, [(FOOT, upright), (NECK, leaning)]


def design(name: str, config: Config) -> tuple[list[tuple[str, Tensor, Topology]], Report]:
    """Without and with prescribed tangent planes."""
    curves, planes = conditions(name, config)
    start, topology = start_surface(curves, config.vertices)
    along = prescribed_normals(start, topology, curves, planes)
    settings = FormSettings(tangent_weight=config.tangent_weight)
    drawn, reports = [], {}
    for kind, given in zip(KINDS, (None, along), strict=True):
        found, report = solve(start, topology, curves=curves, normals=given, levels=config.levels, settings=settings)
        drawn.append((f"tangent planes {kind}", found.vertices, found.topology))
        reports[kind] = report | {"vertices": len(found.vertices), **figures(found.vertices, found.topology)}
        angles = total_absolute_curvature(found.vertices, found.topology, sine=False, boundary="extrapolated")
        reports[kind]["total_absolute_curvature_by_angles"] = float(angles)
    tilt = reports["prescribed"]["after"]["largest_tilt_degrees"]
    return drawn, {"largest_tilt_degrees": tilt, "kinds": reports}


# ---- experiment ----------------------------------------------------------------------------------------


def draw(name: str, drawn: list[tuple[str, Tensor, Topology]], config: Config, results: Results) -> None:
    """Meshes and picture of one case."""
    for file, (_, vertices, topology) in zip(mesh_files(name), drawn, strict=True):
        results.mesh(file, vertices, topology)
    picture_curvature(results.path(f"{name}.png"), drawn, name, width=config.width, overwrite=results.force)


def mesh_files(name: str) -> list[str]:
    """Names of the two meshes of one case."""
    return [f"{name}_{kind}.obj" for kind in (("start", "found") if name in PATCHES else KINDS)]


def experiment(config: Config, results: Results) -> Report:
    """Patches, then designs."""
    patches, designs = {}, {}
    for name, slope in PATCHES.items():
        drawn, report = recover(slope, config)
        patches[name] = report
        draw(name, drawn, config, results)
        print(
            f"{name}: from a bulge of {report['start_distance']:.3g} back to {report['largest_distance']:.2g}, "
            f"C {report['surfaces']['found']['total_absolute_curvature']:.4g} "
            f"instead of {report['exact_absolute_curvature']:.4g}"
        )
    for name in config.designs:
        drawn, report = design(name, config)
        designs[name] = report
        draw(name, drawn, config, results)
        free, fixed = (report["kinds"][kind]["total_absolute_curvature"] for kind in KINDS)
        print(
            f"{name}: C {fixed:.4g} with tangent planes, {free:.4g} without; at most "
            f"{report['largest_tilt_degrees']:.2g} degrees from them"
        )
    return {"patches": patches, "designs": designs}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [file for name in (*PATCHES, *DESIGNS) for file in (f"{name}.png", *mesh_files(name))]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
