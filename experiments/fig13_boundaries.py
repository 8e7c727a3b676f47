"""Paper Fig. 13: surfaces of least total absolute curvature C between two boundary curves.

(a) two coaxial circles, equal and different, from barrels: cylinder and cone, on which C = 2 pi h; (b) a square and a
circle above it; (c) two circles, shifted and tilted against each other. The surface of least C is compared with the
minimal-area surface and the one of least squared
curvature, on the same mesh and from the same start, and with a surface
that is known: the convex hull of the two curves, without its two lids, is developable. Its C is the sum of l |a| over
the edges of a fine hull, which follow its rulings.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _forms import (
    LEAST,
    Mesh,
    circle,
    compare,
    developable_hull,
    mesh_files,
    polygon,
    save_meshes,
    table_line,
)

from torchfair.curves import ClosedCurve
from torchfair.energies import normal_variation
from torchfair.formfinding import start_surface
from torchfair.geometry import ReferenceSurface
from torchfair.viewing import picture_curvature

NAME = "fig13_boundaries"
SQUARE = polygon([(1.2, 1.2, 0.0), (-1.2, 1.2, 0.0), (-1.2, -1.2, 0.0), (1.2, -1.2, 0.0)])
BOUNDARIES: dict[str, tuple[ClosedCurve, ClosedCurve]] = {
    "cylinder": (circle(1.0, 0.0), circle(1.0, 1.0)),
    "cone": (circle(1.0, 0.0), circle(0.6, 0.8)),
    "square_to_circle": (SQUARE, circle(0.7, 0.7)),
    "tilted_circles": (circle(1.0, 0.0), circle(0.8, 0.7, shift=0.4, tilt=0.4)),
}
COAXIAL = {"cylinder": 1.0, "cone": 0.8}  # heights


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    boundaries: tuple[str, ...] = setting(tuple(BOUNDARIES), "pairs of curves", choices=tuple(BOUNDARIES))
    vertices: int = setting(500, "vertices of each start, about", least=40)
    levels: int = setting(1, "how often meshes are refined", least=0)
    bulge: float = setting(0.25, "how far the start between coaxial circles bulges, in heights", least=0)
    iterations: int = setting(60, "most steps towards the surfaces to compare with", least=1)


def start_between(name: str, config: Config) -> Mesh:
    """Straight lines between the curves; a barrel between coaxial circles."""
    vertices, topology = start_surface(BOUNDARIES[name], config.vertices)
    if name in COAXIAL:
        height = COAXIAL[name]
        outwards = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=vertices.dtype)
        outwards = outwards / outwards.norm(dim=1, keepdim=True)
        vertices = vertices + config.bulge * height * (math.pi * vertices[:, 2:] / height).sin() * outwards
    return vertices, topology


def measure(name: str, config: Config, results: Results) -> Report:
    """One pair of curves: surfaces, figures, picture."""
    start = start_between(name, config)
    surfaces, topology, report = compare(start, BOUNDARIES[name], config.levels, config.iterations)
    places, faces = developable_hull(BOUNDARIES[name])
    exact = 2.0 * math.pi * COAXIAL[name] if name in COAXIAL else float(normal_variation(places, faces))
    height = float(places[:, 2].max() - places[:, 2].min())
    distances = ReferenceSurface(places, faces).closest(surfaces[LEAST]).distances
    least = report["surfaces"][LEAST]
    report |= {
        "hull_absolute_curvature": exact,
        "excess": least["total_absolute_curvature"] / exact - 1.0,
        "excess_corrected_estimate": least["corrected_estimate"] / exact - 1.0,
        "largest_distance_from_hull": float(distances.max()) / height,
    }
    save_meshes(results, surfaces, topology, name)
    picture_curvature(
        results.path(f"{name}.png"),
        [(kind, surface, topology) for kind, surface in surfaces.items()],
        f"{name.replace('_', ' ')}: C = {exact:.4g} on the developable surface of the convex hull",
        width=config.width,
        overwrite=results.force,
    )
    print(
        f"{table_line(name, report)}; {exact:.4g} on the hull, "
        f"at most {100 * report['largest_distance_from_hull']:.2f} % of the height away"
    )
    return report


def experiment(config: Config, results: Results) -> Report:
    """All pairs."""
    return {"boundaries": {name: measure(name, config, results) for name in config.boundaries}}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [file for name in BOUNDARIES for file in (f"{name}.png", *mesh_files(name))]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
