"""Reflections rank meshes: principal ones look smoother than others of as many vertices (paper Figs. 1, 10, 14).

Saddle surfaces are meshed in nine layouts at several densities, and every mesh is compared with its surface by the
reflection score (1 - SSIM, mean over four stripe directions) in each of six views. A case is a surface at one density
in one view. Besides, how well the score, the reflection variation of the same views and the energy E agree.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from _charts import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, SKY, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _layouts import (
    ALL_IRREGULAR,
    ELONGATED,
    EQUILATERAL,
    HEXAGONAL_15,
    HEXAGONAL_22,
    IRREGULAR,
    IRREGULAR_2,
    LAYOUTS,
    PRINCIPAL,
    QUADS,
    SADDLES,
    SPLIT_25,
    SPLIT_45,
    TURNED_SPLIT,
    layout,
)
from scipy.stats import spearmanr

from torchfair.energies import normal_variation
from torchfair.reflection import ReflectionScore, ReflectionSetup, SmoothReference, reflection_score
from torchfair.viewing.picture_reflections import mirror_colors
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet

NAME = "fig_reflection_ranking"
TABLE, CHART, PICTURES = "table.txt", "score_and_energy.png", "reflections.png"
COLORS = {
    QUADS: BLUE, ELONGATED: SKY, EQUILATERAL: GREEN, HEXAGONAL_15: GREY, HEXAGONAL_22: GREY,
    SPLIT_25: ORANGE, SPLIT_45: RED, IRREGULAR: PURPLE, IRREGULAR_2: PURPLE,
}  # fmt: skip
QUANTITIES = ("score", "reflection_variation", "energy_per_area", "rms", "wobble")
DRAWN = (QUADS, ELONGATED, EQUILATERAL, HEXAGONAL_15, SPLIT_25, IRREGULAR)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    surfaces: tuple[str, ...] = setting(tuple(SADDLES), "surfaces; the first is drawn", choices=tuple(SADDLES))
    rows: tuple[int, ...] = setting((24, 48, 80), "vertices along a side; the first is drawn", least=8)
    size: int = setting(256, "pixels along a picture", least=32)
    own: bool = setting(False, "compare every mesh with itself, smoothly shaded, instead of the surface")


def measure(name: str, rows: int, setup: ReflectionSetup, config: Config) -> tuple[Report, dict[str, ReflectionScore]]:
    """All layouts of one surface at one density."""
    report, scores = {}, {}
    area = SADDLES[name].area()
    for kind in LAYOUTS:
        mesh = layout(SADDLES[name], kind, rows, config.seed)
        score = reflection_score(mesh.vertices, mesh.topology, setup)
        scores[kind] = score
        report[kind] = {
            "vertices": mesh.topology.num_vertices,
            "score": score.score,
            "score_by_view": score.per_view.mean(-1),
            "score_by_view_and_stripes": score.per_view,
            "reflection_variation": score.reflection_variation,
            "rms": score.rms,
            "wobble": score.wobble,
            "energy_per_area": normal_variation(mesh.vertices, mesh.topology) / area,
        }
    return report, scores


def wins(cases: list[Report], first: str, second: str) -> dict[str, float]:
    """In which part of the cases ``first`` looks smoother than ``second``.

    By the score of single views and of their mean, and in single views by single stripe directions.
    """
    keys = {"views": "score_by_view", "means": "score", "single_stripes": "score_by_view_and_stripes"}
    rates = {
        name: float(torch.stack([case[first][key] < case[second][key] for case in cases]).double().mean())
        for name, key in keys.items()
    }
    for quantity in QUANTITIES[1:]:
        rates[quantity] = float(np.mean([float(c[first][quantity]) < float(c[second][quantity]) for c in cases]))
    return rates


def correlations(cases: list[Report]) -> dict[str, dict[str, float]]:
    """Spearman's rank correlation of pairs of quantities over the layouts: median and smallest of the cases."""
    found = {}
    for first, second in itertools.combinations(QUANTITIES, 2):
        values = []
        for case in cases:
            x, y = ([float(case[kind][quantity]) for kind in LAYOUTS] for quantity in (first, second))
            values.append(float(spearmanr(x, y)[0]))
        found[f"{first}, {second}"] = {"median": float(np.median(values)), "smallest": min(values)}
    return found


def table(pairs: dict[str, dict[str, float]], correlation: dict[str, dict[str, float]]) -> str:
    """Win rates and correlations as text."""
    columns = ("views", "means", "single_stripes", *QUANTITIES[1:])
    lines = ["how often the first layout is better than the second (by score in single views; by their mean; in single",
             "views by a single stripe direction; by ...)"]  # fmt: skip
    lines.append(f"{'':<72}" + "".join(f"{name.replace('_', ' '):>22}" for name in columns))
    lines += [f"{pair:<72}" + "".join(f"{rates[name]:>22.3f}" for name in columns) for pair, rates in pairs.items()]
    lines += ["", "rank correlation over the layouts (median and smallest over surfaces and densities)"]
    lines += [f"{pair:<72}{row['median']:>22.3f}{row['smallest']:>22.3f}" for pair, row in correlation.items()]
    return "\n".join(lines) + "\n"


# ---- pictures ------------------------------------------------------------------------------------------


def draw_scores(report: dict[str, dict[str, Report]], results: Results) -> None:
    """Score over E, both relative to principal quads: a chart for each density, a point for each mesh."""
    densities = list(next(iter(report.values())))
    width = 480
    sheet = Sheet(180 + len(densities) * (width + 90), 740)
    for column, rows in enumerate(densities):
        axes = add_chart(
            sheet, 140 + column * (width + 90), 170, width, 440, title=f"{rows} vertices along a side",
            x=r"$E$ over that of principal quads", y="score over that of principal quads" if column == 0 else "",
        )  # fmt: skip
        for kind in LAYOUTS:
            if kind in (HEXAGONAL_22, IRREGULAR_2):
                continue
            twins = [k for k in LAYOUTS if COLORS[k] == COLORS[kind]]
            pairs = [(case[k], case[QUADS]) for case in (s[rows] for s in report.values()) for k in twins]
            x, y = ([float(mesh[q] / quads[q]) for mesh, quads in pairs] for q in ("energy_per_area", "score"))
            words = kind.removesuffix(" 15°") if kind == HEXAGONAL_15 else kind
            axes.scatter(x, y, s=34, color=COLORS[kind], label=words, edgecolors="white", linewidths=0.6)
    add_legend(sheet.figure, handles=axes.get_legend_handles_labels()[0], loc="upper center", ncols=4)
    sheet.write(results.path(CHART), overwrite=results.force)


def draw_reflections(scores: dict[str, ReflectionScore], results: Results, width: int) -> None:
    """The first view of some layouts and of the smooth surface, with the second stripe direction."""
    first = scores[QUADS]
    pictures = {f"{kind} ({float(scores[kind].score):.3f})": scores[kind] for kind in DRAWN}
    columns = 4
    panel = (width - 2 * MARGIN - (columns - 1) * GAP) // columns
    sheet = Sheet(width, -(-(1 + len(pictures)) // columns) * (panel + CAPTION) + MARGIN)
    size = min(24, 1.65 * panel / max(map(len, pictures)))
    for number, (words, score) in enumerate([("smooth surface", first), *pictures.items()]):
        left, top = MARGIN + number % columns * (panel + GAP), number // columns * (panel + CAPTION)
        image, coverage = score.images[0, 1], score.coverage[0]
        if number == 0:
            image, coverage = score.reference_images[0, 1], score.reference_coverage[0]
        colors = mirror_colors(image, coverage).movedim(-1, 0)[None]
        colors = torch.nn.functional.interpolate(colors, (panel, panel), mode="bilinear")[0].movedim(0, -1)
        sheet.text(words, left + panel / 2, top + CAPTION / 2, size, ha="center", va="center")
        sheet.image(colors, left, top + CAPTION)
    sheet.write(results.path(PICTURES), overwrite=results.force)


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Measures, compares, draws, and prints what came out."""
    report: dict[str, dict[str, Report]] = {}
    drawn: dict[str, ReflectionScore] = {}
    for name in config.surfaces:
        reference = SmoothReference.of_surface(SADDLES[name])
        setup = ReflectionSetup.for_reference(reference, size=config.size)
        report[name] = {}
        for rows in config.rows:
            chosen = setup.without_reference() if config.own else setup
            report[name][str(rows)], scores = measure(name, rows, chosen, config)
            drawn = drawn or scores
        print(f"{name}: principal quads {[round(float(r[QUADS]['score']), 3) for r in report[name].values()]}, "
              f"irregular {[round(float(r[IRREGULAR]['score']), 3) for r in report[name].values()]}")  # fmt: skip
    cases = [case for surface in report.values() for case in surface.values()]
    pairs: dict[str, Any] = {f"{a} < {b}": wins(cases, a, b) for a, b in itertools.permutations(LAYOUTS, 2)}
    asked = {f"{a} < {b}": pairs[f"{a} < {b}"] for a in PRINCIPAL for b in (*TURNED_SPLIT, *ALL_IRREGULAR)}
    others = {f"{a} < {b}": pairs[f"{a} < {b}"] for a in PRINCIPAL for b in (*PRINCIPAL, HEXAGONAL_15, HEXAGONAL_22)
              if a != b}  # fmt: skip
    correlation = correlations(cases)
    results.text(TABLE, table({**asked, **others}, correlation))
    draw_scores(report, results)
    draw_reflections(drawn, results, config.width)
    smallest = min(rates["views"] for rates in asked.values())
    print(f"principal meshes look smoother than turned split and irregular ones in {100 * smallest:.1f} % of the "
          f"cases or more; rank correlation of score and E {correlation['score, energy_per_area']['median']:.2f}, of "
          f"variation and E {correlation['reflection_variation, energy_per_area']['median']:.2f}")  # fmt: skip
    return {
        "surfaces": report,
        "pairs": pairs,
        "smallest_rate_of_principal_meshes": smallest,
        "ties": {pair: rates["views"] for pair, rates in others.items() if 0.1 < rates["views"] < 0.9},
        "correlations": correlation,
        "cases": sum(len(case[QUADS]["score_by_view"]) for case in cases),
    }


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [TABLE, CHART, PICTURES], arguments)


if __name__ == "__main__":
    sys.exit(main())
