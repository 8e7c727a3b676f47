"""Paper section 2.2, remark: which stars arise where saddle surfaces are sampled regularly, less regularly, at random.

The remark says that on a mesh of regular combinatorics from a geometrically regular sampling it is hard to create
saddles with more than four inflection faces, that the asymmetric patterns 2, 2, 1, 1 and 3, 1, 1, 1 of Fig. 4b, c
typically do not occur either, and that there is a nonzero probability of stars that are neither convex nor saddles.

Samplings of surfaces that are negatively curved everywhere:

* *regular*: equilateral lattices in tangent planes, turned by several angles;
* *perturbed*: every vertex moved along the surface in a random direction, by a uniformly random share of a given number
  of mean edges, without changing faces;
* *random*: vertices at random, evened out, with Delaunay triangles; valences differ.

A saddle goes by the best plane that shows it (a good one if there is one, otherwise one that cuts opposite sides
alike): where that is not 1, 2, 1, 2 no plane shows this pattern. Patterns at the vertex normal are counted, too.
Counted are inner vertices of valence six none of whose neighbours is on the boundary.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _charts import BLUE, GREY, ORANGE, SKY, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _layouts import SADDLES
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import edge_lengths
from torchfair.shapes import Paraboloid, ShapeMesh, Surface, irregular_triangles, rotated_lattice
from torchfair.stars import StarKind, classify_stars
from torchfair.viewing.sheet import Sheet

NAME = "saddle_samplings"
TABLE, CHART = "table.md", "stars.png"
SURFACES: dict[str, Surface] = {
    **SADDLES,
    "curvatures 1 : -0.25": Paraboloid(1.0, -0.25),
    "curvatures 1 : -0.1": Paraboloid(1.0, -0.1),
}
COLUMNS = ("good saddles", "other 1, 2, 1, 2", "2, 2, 1, 1", "3, 1, 1, 1", "other saddles", "neither", "convex")
ORDINARY = ("2, 2, 1, 1 at the vertex normal", "3, 1, 1, 1 at the vertex normal")
MANY = ("saddles with more than 4 inflection faces", "stars with more than 4 inflection faces")
BAD: dict[tuple[int, ...], str]
BAD = {(1, 2, 1, 2): "other 1, 2, 1, 2", (2, 2, 1, 1): "2, 2, 1, 1", (3, 1, 1, 1): "3, 1, 1, 1"}
ORDINARY_PATTERNS: dict[tuple[int, ...], str] = {(2, 2, 1, 1): ORDINARY[0], (3, 1, 1, 1): ORDINARY[1]}
REGULAR, RANDOM = "regular", "random"


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    surfaces: tuple[str, ...] = setting(tuple(SURFACES), "saddle surfaces", choices=tuple(SURFACES))
    rows: int = setting(20, "cells along a surface, about", least=6)
    angles: int = setting(6, "directions of regular lattices, between 0 and 60 degrees", least=1)
    perturbations: tuple[float, ...] = setting((0.02, 0.05, 0.1, 0.2, 0.3), "largest moves, in mean edges", least=0)
    seeds: int = setting(3, "seeds of every random sampling", least=1)


# ---- samplings -----------------------------------------------------------------------------------------


def lattices(config: Config, surface: str) -> list[ShapeMesh]:
    """Regular lattices of a surface in all directions."""
    return [
        rotated_lattice(SURFACES[surface], config.rows, config.rows, math.radians(60 * (turn + 0.5) / config.angles))
        for turn in range(config.angles)
    ]


def moved(mesh: ShapeMesh, size: float, generator: torch.Generator) -> Tensor:
    """Vertices (V, 3) moved along the surface by up to ``size`` mean edges."""
    u, v = mesh.parameters.unbind(1)
    edge = float(edge_lengths(mesh.vertices, mesh.topology).mean())
    count = len(u)
    angle = 2 * math.pi * torch.rand(count, generator=generator, dtype=u.dtype)
    step = size * edge * torch.rand(count, generator=generator, dtype=u.dtype)
    frame = mesh.surface.frame(u, v)
    wanted = step[:, None] * (angle.cos()[:, None] * frame[:, 0] + angle.sin()[:, None] * frame[:, 1])
    tangents = torch.stack(mesh.surface.tangents(u, v), dim=-1)
    change = torch.linalg.lstsq(tangents, wanted[..., None]).solution[..., 0]
    return mesh.surface.position(u + change[:, 0], v + change[:, 1])


def samplings(config: Config) -> dict[str, dict[str, list[tuple[Tensor, Topology]]]]:
    """Meshes of every surface by every sampling."""
    found: dict[str, dict[str, list[tuple[Tensor, Topology]]]] = {}
    for surface in config.surfaces:
        meshes = lattices(config, surface)
        kinds = {REGULAR: [(mesh.vertices, mesh.topology) for mesh in meshes]}
        for size in config.perturbations:
            kinds[f"moved by up to {size:g} edges"] = [
                (moved(mesh, size, torch.Generator().manual_seed(1000 * config.seed + seed)), mesh.topology)
                for mesh in meshes
                for seed in range(config.seeds)
            ]
        scattered = [
            irregular_triangles(SURFACES[surface], config.rows**2, seed=100 * config.seed + seed)
            for seed in range(2 * config.seeds)
        ]
        kinds[RANDOM] = [(mesh.vertices, mesh.topology) for mesh in scattered]
        found[surface] = kinds
    return found


# ---- what is counted -----------------------------------------------------------------------------------


def counted(topology: Topology) -> Tensor:
    """(V,) bool: inner vertices of valence six without a neighbour on the boundary."""
    v, w = topology.edges.unbind(1)
    boundary = topology.is_boundary_vertex
    beside = boundary.clone()
    beside[w[boundary[v]]] = True
    beside[v[boundary[w]]] = True
    return ~beside & (topology.valences == 6)


def count(vertices: Tensor, topology: Topology) -> dict[str, int]:
    """How many stars of one mesh are what."""
    classes, chosen = classify_stars(vertices, topology), counted(topology)
    numbers = torch.nonzero(chosen).squeeze(1).tolist()
    saddle, good = classes.is_kind(StarKind.SADDLE), classes.good
    many = classes.inflection_counts > 4
    rows = dict.fromkeys((*COLUMNS, *ORDINARY), 0)
    for vertex in numbers:
        if bool(good[vertex]):
            rows["good saddles"] += 1
        elif bool(saddle[vertex]):
            rows[BAD.get(classes.pattern(vertex), "other saddles")] += 1
        if bool(saddle[vertex]):
            name = ORDINARY_PATTERNS.get(classes.pattern(vertex, ordinary=True))
            rows.update({name: rows[name] + 1} if name else {})
    rows["neither"] = int((chosen & classes.is_kind(StarKind.NEITHER)).sum())
    rows["convex"] = int((chosen & classes.is_kind(StarKind.CONVEX)).sum())
    inflections = dict(zip(MANY, (int((chosen & saddle & many).sum()), int((chosen & many).sum())), strict=True))
    return {"stars": len(numbers), **rows, **inflections}


def total(rows: list[dict[str, int]]) -> dict[str, int]:
    """Counts of several meshes."""
    return {key: sum(row[key] for row in rows) for key in rows[0]}


# ---- experiment ----------------------------------------------------------------------------------------


def table(report: dict[str, dict[str, int]]) -> str:
    """Shares in percent, one column for each sampling."""
    lines = ["| | " + " | ".join(report) + " |", "|---" * (len(report) + 1) + "|"]
    lines.append("| stars | " + " | ".join(str(row["stars"]) for row in report.values()) + " |")
    for name in (*COLUMNS, *ORDINARY, *MANY):
        shares = (_percent(row[name], row["stars"]) for row in report.values())
        lines.append(f"| {name} | " + " | ".join(shares) + " |")
    return "\n".join(lines) + "\n"


def _percent(part: int, whole: int) -> str:
    """Two digits of a share, and 0 for none at all."""
    share = 100 * part / max(whole, 1)
    return "0" if not part else f"{share:.0f} %" if share >= 10 else f"{share:.2g} %"


PARTS = {
    "good saddles": (("good saddles",), BLUE),
    "other saddles": (("other 1, 2, 1, 2", "2, 2, 1, 1", "3, 1, 1, 1", "other saddles"), SKY),
    "neither convex nor saddle": (("neither",), ORANGE),
    "convex": (("convex",), GREY),
}


def draw_shares(report: dict[str, dict[str, int]], results: Results) -> None:
    """Stars by what they are: a bar for each sampling."""
    sheet = Sheet(1300, 210 + 52 * len(report))
    axes = add_chart(sheet, 360, 80, 880, 52 * len(report), x="percent of stars of valence six")
    done = [0.0] * len(report)
    for words, (columns, color) in PARTS.items():
        shares = [100 * sum(row[name] for name in columns) / max(1, row["stars"]) for row in report.values()]
        if any(shares):
            axes.barh(range(len(report)), shares, 0.66, left=done, color=color, label=words)
        done = [left + share for left, share in zip(done, shares, strict=True)]
    axes.set_yticks(range(len(report)), list(report))
    axes.set_xlim(0, 100)
    axes.invert_yaxis()
    add_legend(axes, loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=len(PARTS))
    sheet.write(results.path(CHART), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Samples, counts, writes the table and draws it."""
    by_surface = {
        surface: {kind: total([count(*mesh) for mesh in meshes]) for kind, meshes in kinds.items()}
        for surface, kinds in samplings(config).items()
    }
    kinds = by_surface[config.surfaces[0]]
    overall = {kind: total([rows[kind] for rows in by_surface.values()]) for kind in kinds}
    text = table(overall)
    print(text, end="")
    results.text(TABLE, text)
    draw_shares(overall, results)
    return {"all": overall, "surfaces": by_surface}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [TABLE, CHART], arguments)


if __name__ == "__main__":
    sys.exit(main())
