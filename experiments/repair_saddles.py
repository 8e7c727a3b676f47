"""Bad saddles removed from meshes near their surface, few vertices moved (not in the paper).

A lattice on the saddle z = x^2 - y^2/2 whose vertices are shifted at random along the surface has bad saddles and
stars that are no saddles at all. Guided projection with the saddle term, closeness to the surface and a smoothed
norm of every displacement, which prefers a few large ones to many small ones, turns inner stars into good saddles.
For comparison the same with the pyramid term, which only asks for pyramids without self-intersections.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import closeness_terms, pyramid_terms, saddle_terms
from torchfair.constraints.closeness import TangentPlanes
from torchfair.geometry import edge_lengths
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.projection import ElementTerm, ProjectionSettings, guided_projection
from torchfair.projection.loss import SmoothAbsolute
from torchfair.shapes import Paraboloid, rotated_lattice
from torchfair.stars import StarKind, classify_stars, pyramid_self_intersections
from torchfair.viewing import picture_star_classes

NAME = "repair_saddles"
PICTURES = {"start": "start.png", "saddle term": "saddle_term.png", "pyramid term": "pyramid_term.png"}
MESHES = {"start": "start.obj", "saddle term": "saddle_term.obj", "pyramid term": "pyramid_term.obj"}
MOVED = 0.01


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    rows: int = setting(20, "rows of the lattice", least=4)
    angle: float = setting(0.0, "degrees by which the lattice is turned against the principal directions")
    perturbation: float = setting(0.25, "largest shift of a vertex along x and y, in mean edges", least=0)
    stay: float = setting(0.003, "weight of the displacements", least=0)
    closeness: float = setting(100.0, "weight of the distance from the surface", least=0)
    saddles: float = setting(1e4, "weight of the saddle term and of the pyramid term", least=0)
    rounds: int = setting(3, "times that the sides of edges are chosen anew", least=1)
    margin: float = setting(0.003, "sine by which bends and sides of edges shall be clear of zero", least=0)
    iterations: int = setting(40, "damped steps of a round at most", least=1)


def start_mesh(config: Config) -> tuple[Tensor, Topology, Tensor, Topology]:
    """The perturbed lattice, scaled to unit mean edges, and the surface as a fine mesh of the same scale."""
    surface = Paraboloid(2.0, -1.0)
    lattice = rotated_lattice(surface, config.rows, config.rows, torch.tensor(config.angle).deg2rad().item())
    fine = rotated_lattice(surface, 5 * config.rows, 5 * config.rows, 0.0)
    length = float(edge_lengths(lattice.vertices, lattice.topology).mean())
    random = torch.Generator().manual_seed(config.seed)
    shift = (2 * torch.rand(lattice.parameters.shape, generator=random, dtype=torch.float64) - 1) * config.perturbation
    shift = torch.where(lattice.topology.is_boundary_vertex[:, None], 0.0, shift * length)
    u, v = (lattice.parameters + shift).unbind(1)
    return surface.position(u, v) / length, lattice.topology, fine.vertices / length, fine.topology


def repair(
    start: Tensor,
    topology: Topology,
    planes: TangentPlanes,
    terms: Callable[[Tensor], list[ElementTerm]],
    config: Config,
) -> Tensor:
    """Vertices after some rounds of guided projection; those on the boundary are fixed."""

    def displacement(x: Tensor, place: Tensor) -> Tensor:
        return x[0] - place

    everyone = torch.arange(topology.num_vertices)[:, None]
    stay = ElementTerm(
        "stay", displacement, [("vertices", everyone)], data=(start,), weight=config.stay, loss=SmoothAbsolute(1e-3)
    )
    near = closeness_terms(planes, torch.arange(topology.num_vertices), weight=config.closeness)
    fixed = topology.is_boundary_vertex[:, None].expand(-1, 3)
    settings = ProjectionSettings(
        max_iterations=config.iterations, initial_damping=1e-2, damping_scale="identity", merit_tolerance=1e-5
    )
    vertices = start
    for _ in range(config.rounds):
        result = guided_projection(
            {"vertices": vertices}, [*terms(vertices), *near, stay], fixed={"vertices": fixed}, settings=settings
        )
        vertices = result.blocks["vertices"]
    return vertices


def measure(vertices: Tensor, start: Tensor, topology: Topology, planes: TangentPlanes) -> Report:
    """Classes of stars, folded pyramids, and how far vertices went, in mean edges."""
    classes = classify_stars(vertices, topology)
    moved = torch.linalg.vector_norm(vertices - start, dim=1)
    return {
        "inner_vertices": int((~classes.is_kind(StarKind.EXCLUDED)).sum()),
        "good_saddle": int(classes.good.sum()),
        "saddle": int(classes.is_kind(StarKind.SADDLE).sum()),
        "neither": int(classes.is_kind(StarKind.NEITHER).sum()),
        "self_intersecting_pyramids": int((pyramid_self_intersections(vertices, topology) > 0).sum()),
        "moved_vertices": int((moved > MOVED).sum()),
        "largest_displacement": float(moved.max()),
        "largest_distance": float((planes({"vertices": vertices})[0] - vertices).norm(dim=1).max()),
    }


def experiment(config: Config, results: Results) -> Report:
    """Repairs, counts, draws, and prints what came out."""
    vertices, topology, fine, fine_topology = start_mesh(config)
    planes = TangentPlanes(ReferenceSurface(fine, fine_topology))
    inner = ~topology.is_boundary_vertex
    jobs: dict[str, Callable[[Tensor], list[ElementTerm]]] = {
        "saddle term": lambda x: saddle_terms(x, topology, inner, weight=config.saddles, margin=config.margin),
        "pyramid term": lambda x: pyramid_terms(topology, weight=config.saddles),
    }
    found = {"start": vertices}
    for name, terms in jobs.items():
        found[name] = repair(vertices, topology, planes, terms, config)
    rows = {}
    for name, positions in found.items():
        row = rows[name] = measure(positions, vertices, topology, planes)
        print(f"{name}: {row['good_saddle']} of {row['inner_vertices']} good saddles, {row['neither']} neither, "
              f"{row['self_intersecting_pyramids']} folded pyramids; {row['moved_vertices']} vertices moved, at most "
              f"{row['largest_displacement']:.3f} mean edges, {row['largest_distance']:.4f} off it")  # fmt: skip
        results.mesh(MESHES[name], positions, topology)
        crossings, classes = pyramid_self_intersections(positions, topology), classify_stars(positions, topology)
        picture_star_classes(results.path(PICTURES[name]), positions, classes, crossings, overwrite=results.force)
    return {"results": rows}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [*PICTURES.values(), *MESHES.values()]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
