"""An edit of a principal-symmetric mesh, one handle moved, in three formulations; and table 20 of the paper.

Run ``python benchmarks/bench_principal_symmetric.py [--cases 480 714 1920] [--formulations spheres eliminated lifted]
[--threads 1 2] [--repeats 3] [--table 5ac 14bc ...] [--lifted-most 714] [--json FILE]``.

The mesh has been designed by handles before, so everything is compiled and the conditions are met. Then one handle
moves on by the length of a mean edge (or ``--move``), and the design answers: a handle outwards, the same one inwards,
the next one outwards, the first one up by half of that. All edits start from the same state; formulations take turns.
Meshes: tori of 480 and 1920 vertices drawn into ovals (paper Fig. 14), the annulus of 714 vertices pulled out of round
(Fig. 5). The paper prints sizes, not meshes; its times are those of another machine.

=============  =========================================================================================
unknowns       all variable blocks
to 1e-6        damped steps until the largest relative residual is below 1e-6 for the first time, of the edit that
               takes most (target: 25)
steps          damped steps of the whole answer, rejected ones too, median and most: rounds for saddle sides that
               come out wrong follow
answer         wall seconds from the call to the return, median and most; proc.: processor time, median
steps/s        all steps over the wall seconds of all answers, compilation of terms included where a formulation
               needs it anew (targets: 20 at 480 and 714 vertices, 4 at 1920); proc.: over processor time
spheres over   time of the answers over that of ``spheres``
paper over     seconds of a step as printed in table 20 over ours
residual       largest relative residual at the end; sides: least share of right saddle sides; handles: largest
               distance from its target, in mean edges (above 0.1 the design gave an edit up)
=============  =========================================================================================
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import statistics
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from symmetric_problems import CASES, SHAPES, Handles, prepared, variables_as_printed
from torch import Tensor

import torchfair
from torchfair.formfinding import SymmetricDesign
from torchfair.formfinding.symmetric.measures import condition_residuals
from torchfair.geometry import edge_lengths
from torchfair.projection.layout import State
from torchfair.settings.symmetric_settings import Formulation

FORMULATIONS = ("spheres", "eliminated", "lifted")
WANTED = 1e-6
MOST_STEPS = 25
LIFTED_MOST = 1920  # vertices in table 20; beyond, a step takes minutes


def largest_residual(design: SymmetricDesign, vertices: Tensor) -> float:
    """Largest relative residual of both conditions."""
    residuals = condition_residuals(vertices, design.principal, design.stars)
    return max(float(values.max()) for values in residuals.values() if values.numel())


@dataclass(frozen=True)
class Answer:
    """What an edit made of a design.

    Attributes:
        runs: Of the edit.
        measures: Of the mesh after it.
        residual: Largest relative residual of the conditions.
        seconds: Wall and processor time.
    """

    runs: list[torchfair.projection.ProjectionResult]
    measures: dict[str, float]
    residual: float
    seconds: tuple[float, float]


def edited(design: SymmetricDesign, places: Handles, callback: torchfair.projection.Callback | None = None) -> Answer:
    """An edit of the design, which is as it was before afterwards, but for what is compiled."""
    before, first = design.session.snapshot(), len(design.runs)
    begin, processor = time.perf_counter(), time.process_time()
    design.move(places, callback, rounds=1)
    seconds = time.perf_counter() - begin, time.process_time() - processor
    answer = Answer(design.runs[first:], design.measures(), largest_residual(design, design.vertices), seconds)
    design.session.restore(before)
    return answer


def steps_to_residual(design: SymmetricDesign, places: Handles) -> int | None:
    """Damped steps of the edit until the largest relative residual is below 1e-6; None if it never is."""
    problem, seen = design.session.recipe.problem, [0.0]
    admits = problem.admits

    def watched(state: State, trial: State) -> bool:
        seen[-1] = largest_residual(design, state["vertices"])  # of the best state after so many steps
        return admits(state, trial)

    def count(record: torchfair.projection.IterationRecord) -> bool:
        if record.iteration:
            seen.append(seen[-1])
        return False

    problem.admits = watched  # type: ignore[method-assign]
    try:
        seen[-1] = edited(design, places, count).residual
    finally:
        problem.admits = admits  # type: ignore[method-assign]
    left = next((step for step, value in enumerate(seen) if value >= WANTED), 0)  # the first steps may be rejected
    return next((step for step in range(left, len(seen)) if seen[step] < WANTED), None)


class Edits:
    """One case in one formulation, designed and ready to be edited again and again."""

    def __init__(self, size: int, formulation: Formulation, move: float) -> None:
        self.size, self.formulation = size, formulation
        self.design, handles = prepared(SHAPES[size], formulation)
        self.design.move(handles)
        step = move * float(edge_lengths(self.design.vertices, self.design.topology).mean())
        self.places: list[Handles] = []
        for number, outwards, upwards in ((0, 1.0, 0.0), (0, -1.0, 0.0), (1, 1.0, 0.0), (0, 0.0, 0.5)):
            vertex = list(handles)[number]
            x, y, z = handles[vertex]
            stretch = 1.0 + outwards * step / math.hypot(x, y)
            self.places.append({**handles, vertex: [stretch * x, stretch * y, z + upwards * step]})
        self.times: list[list[tuple[float, float]]] = []

    def run(self) -> None:
        """Every edit once."""
        self.answers = [edited(self.design, places) for places in self.places]
        self.times.append([answer.seconds for answer in self.answers])

    def row(self) -> dict[str, Any]:
        """Figures; times are the least of the repetitions of an edit."""
        steps = [sum(run.iterations for run in answer.runs) for answer in self.answers]
        seconds = [[min(times) for times in zip(*edit, strict=True)] for edit in zip(*self.times, strict=True)]
        wall, processor = zip(*seconds, strict=True)
        engine = sum(run.timings["total"] for answer in self.answers for run in answer.runs)
        measures = [answer.measures for answer in self.answers]
        away = [m["largest_handle_distance"] / m["mean_edge_length"] for m in measures]
        return {
            "vertices": self.size,
            "formulation": self.formulation,
            "unknowns": sum(block.numel() for block in self.design.session.state.values()),
            "steps": steps,
            "steps_to_1e-6": [steps_to_residual(self.design, places) for places in self.places],
            "answer_s": wall,
            "answer_processor_s": processor,
            "step_s": engine / sum(steps),
            "largest_residual": max(answer.residual for answer in self.answers),
            "saddle_side_share": min(m["saddle_side_share"] for m in measures),
            "crossing_pyramids_negative": max(m["crossing_pyramids_negative"] for m in measures),
            "largest_handle_distance": max(away),
            "paper_step_s": next(case.seconds for case in CASES.values() if case.size == self.size),
            "target_steps_per_s": SHAPES[self.size].target,
        }


HEADER = f"{'V':>5} {'formulation':12}{'unkn.':>7}{'to 1e-6':>8}{'steps':>9}{'answer':>13}{'proc.':>7}{'ms/step':>8}\
{'steps/s':>8}{'proc.':>6}{'spheres over':>13}{'paper over':>11}{'residual':>10}{'sides':>7}{'handles':>9}"


def report(row: dict[str, Any], spheres: dict[str, Any] | None) -> None:
    """One line of the table."""
    total = sum(row["steps"])
    wall, processor = (total / sum(row[kind]) for kind in ("answer_s", "answer_processor_s"))
    reached = max(math.inf if steps is None else steps for steps in row["steps_to_1e-6"])
    over = f"{sum(row['answer_s']) / sum(spheres['answer_s']):.2f}" if spheres else "-"
    steps = f"{statistics.median(row['steps']):.0f}, {max(row['steps'])}"
    answer = f"{statistics.median(row['answer_s']):.2f}, {max(row['answer_s']):.2f}"
    print(
        f"{row['vertices']:>5} {row['formulation']:12}{row['unknowns']:>7}{reached:>8}{steps:>9}{answer:>13}"
        f"{statistics.median(row['answer_processor_s']):7.2f}{1e3 * row['step_s']:8.1f}{wall:8.1f}{processor:6.1f}"
        f"{over:>13}{row['paper_step_s'] / row['step_s']:11.1f}{row['largest_residual']:10.1e}"
        f"{100 * row['saddle_side_share']:6.1f}%{row['largest_handle_distance']:9.4f}",
        end="",
    )
    target = row["target_steps_per_s"]
    if row["formulation"] == "spheres" and target:
        quick = reached <= MOST_STEPS
        print(f"  {verdict(wall >= target)} ({target:.0f}/s), {verdict(quick)} ({MOST_STEPS} steps)", end="")
    print(flush=True)


def verdict(met: bool) -> str:
    return "met" if met else "MISSED"


def edits(
    sizes: list[int], formulations: list[Formulation], repeats: int, move: float, lifted_most: int
) -> list[dict[str, Any]]:
    """All edits of all cases, formulations in turn."""
    rows: list[dict[str, Any]] = []
    for size in sizes:
        cases = [Edits(size, name, move) for name in formulations if name != "lifted" or size <= lifted_most]
        for _ in range(repeats):
            for case in cases:
                case.run()
        found = {case.formulation: case.row() for case in cases}
        for row in found.values():
            report(row, found.get("spheres"))
        rows += found.values()
    return rows


def table_20(figures: list[str], formulations: list[Formulation], steps: int) -> list[dict[str, Any]]:
    """Variables and seconds of a damped step from the first pull of the handles, beside the paper's."""
    print(f"\n{'ours':>44}{'paper':>41}\n{'fig.':>5}{'V':>6}{'E':>7}{'F':>7}{'stars':>7}  {'formulation':12}", end="")
    print(f"{'variables':>10}{'as printed':>11}{'s/step':>8}{'variables':>11}{'s/step':>8}{'over ours':>11}")
    rows = []
    for figure in figures:
        case = CASES[figure]
        for formulation in formulations:
            if formulation == "lifted" and case.size > LIFTED_MOST:
                continue
            shape = SHAPES[case.size]
            weight = case.energy_weight if formulation == "lifted" else 0.0  # as the paper counts
            design, handles = prepared(
                shape, formulation, most_steps=steps, on_polylines=case.on_polylines, energy_weight=weight
            )
            design.move(handles)
            taken = sum(run.iterations for run in design.runs)
            seconds = sum(run.timings["total"] for run in design.runs) / taken
            variables = max(sum(block.numel() for block in run.blocks.values()) for run in design.runs)
            mesh, stars = design.topology, design.stars.vertices.shape[0]
            printed = variables_as_printed(
                mesh.num_vertices, mesh.num_edges, mesh.num_faces, with_energy=case.energy_weight > 0.0
            )
            rows.append({
                "figure": figure, "vertices": mesh.num_vertices, "edges": mesh.num_edges, "faces": mesh.num_faces,
                "stars": stars, "formulation": formulation, "variables": variables, "step_s": seconds,
                "counted_as_printed": printed, "paper_variables": 1000 * case.variables, "paper_step_s": case.seconds,
            })  # fmt: skip
            print(
                f"{figure:>5}{mesh.num_vertices:>6}{mesh.num_edges:>7}{mesh.num_faces:>7}{stars:>7}  "
                f"{formulation:12}{variables:>10}{printed:>11}{seconds:8.3f}{case.variables:>10}k{case.seconds:8.2f}"
                f"{case.seconds / seconds:11.1f}",
                flush=True,
            )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs="*", default=[480, 714, 1920], choices=list(SHAPES))
    parser.add_argument("--formulations", nargs="+", default=list(FORMULATIONS), choices=FORMULATIONS)
    parser.add_argument("--threads", type=int, nargs="+", default=sorted({1, torch.get_num_threads()}))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--move", type=float, default=1.0, help="of the handle, in mean edges (default: %(default)s)")
    parser.add_argument("--table", nargs="*", default=list(CASES), choices=list(CASES), help="figures; none: left out")
    parser.add_argument("--table-steps", type=int, default=6, help="damped steps in each row (default: %(default)s)")
    parser.add_argument("--lifted-most", type=int, default=714, help="largest edit in the paper's variables")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    machine = platform.processor() or platform.machine()
    print(f"{machine}, torch {torch.__version__}, load {os.getloadavg()[0]:.1f}; seconds")
    document: dict[str, Any] = {"torchfair": torchfair.__version__, "torch": torch.__version__}
    document["load"] = os.getloadavg()
    for threads in options.threads:
        torch.set_num_threads(threads)
        print(f"\n{threads} thread(s), load {os.getloadavg()[0]:.1f}\n{HEADER}")
        document[f"edits_{threads}"] = edits(
            options.cases, options.formulations, options.repeats, options.move, options.lifted_most
        )
    document["table_20"] = table_20(options.table, options.formulations, options.table_steps)
    print(f"load at the end {os.getloadavg()[0]:.1f}")
    if options.json:
        options.json.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
