"""Paper Fig. 12 continued: self-intersecting normal pyramids before and after minimising E.

Meshes are optimised by the job of ``torchfair fair`` with its default settings: vertices slide near the surface,
the boundary glides along itself. Before and after, stars are judged and pyramids that intersect themselves counted;
besides, how deep the self-intersections are (the pyramid penalty, a sum of squared angles).

Built-in meshes, and with ``--meshes FOLDER`` all OBJ, OFF and PLY files of a folder.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from _charts import BLUE, GREY, ORANGE, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation
from torchfair.formfinding import minimise_normal_variation
from torchfair.io import load_mesh
from torchfair.shapes import EXAMPLES, SURFACES, builtin_mesh
from torchfair.stars import StarKind, classify_stars, pyramid_penalty, pyramid_self_intersections
from torchfair.viewing import picture_star_classes
from torchfair.viewing.sheet import Sheet, points

NAME = "fig12_pyramids"
TABLE, CHART = "table.txt", "pyramids.png"
BEFORE, AFTER = "first_before.png", "first_after.png"
COLUMNS = {
    "E": "normal_variation",
    "folded pyramids": "self_intersecting_pyramids",
    "penalty": "pyramid_penalty",
    "neither": "neither",
    "good saddles": "good_saddle",
}
Mesh = tuple[Tensor, Topology]


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    builtin: tuple[str, ...] = setting(
        ("roof", "hybrid_roof", "catenoid", "inner_torus", "enneper", "helicoid", "canopy", "paraboloid"),
        "built-in meshes; the first is drawn", choices=(*EXAMPLES, *SURFACES),
    )  # fmt: skip
    meshes: str = setting("", "folder with further mesh files")


def all_meshes(config: Config) -> dict[str, Mesh]:
    """Meshes by name."""
    chosen = {name: builtin_mesh(name) for name in config.builtin}
    files = sorted(Path(config.meshes).iterdir()) if config.meshes else []
    for path in files:
        if path.suffix.lower() in (".obj", ".off", ".ply"):
            mesh = load_mesh(path)
            chosen[path.name] = (mesh.vertices, mesh.topology)
    return chosen


def measure(vertices: Tensor, topology: Topology) -> Report:
    """E, classes of stars and folded pyramids."""
    classes = classify_stars(vertices, topology)
    folded = pyramid_self_intersections(vertices, topology) > 0
    kinds = {kind.name.lower(): classes.is_kind(kind) for kind in StarKind}
    return {
        "normal_variation": float(normal_variation(vertices, topology)),
        "inner_vertices": int((~kinds["excluded"]).sum()),
        "convex": int(kinds["convex"].sum()),
        "saddle": int(kinds["saddle"].sum()),
        "good_saddle": int(classes.good.sum()),
        "neither": int(kinds["neither"].sum()),
        "self_intersecting_pyramids": int(folded.sum()),
        "pyramid_penalty": float(pyramid_penalty(vertices, topology)),
    }


def table(rows: dict[str, dict[str, Report]]) -> str:
    """One line per mesh."""
    lines = [f"{'mesh':<30} {'inner':>6}" + "".join(f"{title:>22}" for title in COLUMNS)]
    for name, row in rows.items():
        line = f"{name:<30} {row['before']['inner_vertices']:>6}"
        for key in COLUMNS.values():
            before, after = row["before"][key], row["after"][key]
            words = f"{before:.4g} > {after:.4g}" if isinstance(before, float) else f"{before} > {after}"
            line += f"{words:>22}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def draw_shares(rows: dict[str, dict[str, Report]], results: Results) -> None:
    """Share of self-intersecting pyramids before and after, a pair of bars per mesh."""
    sheet = Sheet(1700, 170 + 62 * len(rows))
    axes = add_chart(sheet, 420, 60, 1200, 62 * len(rows), x="self-intersecting pyramids, percent of inner vertices")
    for offset, when, color in ((-0.2, "before", ORANGE), (0.2, "after", BLUE)):
        shares = [
            100 * r[when]["self_intersecting_pyramids"] / max(1, r[when]["inner_vertices"]) for r in rows.values()
        ]
        axes.barh([i + offset for i in range(len(rows))], shares, 0.36, color=color, label=when)
        for place, share in enumerate(shares):
            axes.text(share + 0.4, place + offset, f"{share:.1f}", fontsize=points(17), color=GREY, va="center")
    axes.set_yticks(range(len(rows)), [name.replace("_", " ") for name in rows])
    axes.invert_yaxis()
    add_legend(axes, loc="lower right")
    sheet.write(results.path(CHART), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """Optimises, counts, draws, and prints what came out."""
    rows: dict[str, dict[str, Report]] = {}
    for number, (name, (vertices, topology)) in enumerate(all_meshes(config).items()):
        moved = minimise_normal_variation(vertices, topology).vertices
        rows[name] = {"before": measure(vertices, topology), "after": measure(moved, topology)}
        before, after = rows[name]["before"], rows[name]["after"]
        energies, folded = ([row[key] for row in (before, after)] for key in
                            ("normal_variation", "self_intersecting_pyramids"))  # fmt: skip
        print(f"{name}: E {energies[0]:.4g} -> {energies[1]:.4g}, self-intersecting pyramids "
              f"{folded[0]} -> {folded[1]} of {before['inner_vertices']}")  # fmt: skip
        if number == 0:
            for file, positions in ((BEFORE, vertices), (AFTER, moved)):
                crossings = pyramid_self_intersections(positions, topology)
                classes = classify_stars(positions, topology)
                picture_star_classes(results.path(file), positions, classes, crossings, overwrite=results.force)
    results.text(TABLE, table(rows))
    draw_shares(rows, results)
    total = {w: sum(row[w]["self_intersecting_pyramids"] for row in rows.values()) for w in ("before", "after")}
    return {"meshes": rows, "self_intersecting_pyramids": total}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [TABLE, CHART, BEFORE, AFTER], arguments)


if __name__ == "__main__":
    sys.exit(main())
