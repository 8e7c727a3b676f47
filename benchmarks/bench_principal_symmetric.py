"""An edit of a principal-symmetric mesh, one handle moved, in three formulations; and table 20 of the paper.

Run ``python benchmarks/bench_principal_symmetric.py [--cases 480 714 1920] [--formulations spheres eliminated lifted]
[--threads 1 2] [--repeats 3] [--table 5ac 14bc ...] [--lifted-most 714] [--json FILE]``.

The mesh has been designed by handles before, so everything is compiled and the conditions are met. Then one handle
moves on by the length of a mean edge (or ``--move``), and the design answers, several times from the same state, all
formulations in turn. Meshes: tori of 480 and 1920 vertices drawn into ovals (paper Fig. 14), the annulus of 714
vertices pulled out of round (Fig. 5). The paper prints sizes, not meshes; its times are those of another machine.

=============  =========================================================================================
unknowns       all variable blocks
steps          damped steps of the whole answer, rejected ones too
to 1e-6        damped steps until the largest relative residual of the vertices stays below 1e-6 (target: 25)
answer, proc.  seconds of wall and of processor from the call to the return, least of the repetitions
ms/step        wall time of guided projection over its steps: what a drag feels
steps/s        steps over seconds of the whole answer, compilation of terms included where a formulation needs it
               anew (targets: 20 at 480 and 714 vertices, 4 at 1920); ``proc.`` over processor time
spheres over   time of the answer over that of ``spheres``
paper over     seconds of a step as printed in table 20 over ours
residual       largest relative residual at the end; sides: share of right saddle sides
=============  =========================================================================================
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import os
import platform
import time
from pathlib import Path

import torch
from symmetric_problems import CASES, SHAPES, Handles, prepared
from torch import Tensor

import torchfair
from torchfair.formfinding.symmetric_design import SymmetricDesign
from torchfair.formfinding.symmetric_report import condition_residuals
from torchfair.geometry import edge_lengths
from torchfair.projection.layout import State

FORMULATIONS = ("spheres", "eliminated", "lifted")
WANTED = 1e-6
MOST_STEPS = 25
LIFTED_MOST = 1920  # vertices in table 20; beyond, a step takes minutes


def largest_residual(design: SymmetricDesign, vertices: Tensor) -> float:
    """Largest relative residual of both conditions."""
    residuals = condition_residuals(vertices, design.principal, design.stars)
    return max(float(values.max()) for values in residuals.values() if values.numel())


def edited(design: SymmetricDesign, places: Handles) -> tuple[SymmetricDesign, float, float]:
    """A copy of the design after an edit; wall and processor seconds."""
    answer = copy.copy(design)  # shares what is compiled
    answer.runs = []
    begin, processor = time.perf_counter(), time.process_time()
    answer.move(places)
    return answer, time.perf_counter() - begin, time.process_time() - processor


def steps_to_residual(design: SymmetricDesign, places: Handles) -> int | None:
    """Damped steps of the edit until the largest relative residual stays below 1e-6; None if it does not."""
    answer = copy.copy(design)
    answer.runs = []
    problem, seen = answer.problem, [math.inf]
    admits = problem.admits

    def watched(state: State, trial: State) -> bool:
        seen[-1] = largest_residual(answer, state["vertices"])  # of the best state after so many steps
        return admits(state, trial)

    def count(record: torchfair.projection.IterationRecord) -> bool:
        if record.iteration:
            seen.append(seen[-1])
        return False

    problem.admits = watched  # type: ignore[method-assign]
    try:
        answer.move(places, count)
    finally:
        problem.admits = admits  # type: ignore[method-assign]
    seen[-1] = largest_residual(answer, answer.vertices)
    above = [step for step, value in enumerate(seen) if not value < WANTED]
    return 0 if not above else None if above[-1] + 1 == len(seen) else above[-1] + 1


class Edit:
    """One case in one formulation, designed and ready to be edited again and again."""

    def __init__(self, size: int, formulation: str, move: float) -> None:
        self.size, self.formulation = size, formulation
        self.design, handles = prepared(SHAPES[size], formulation)
        self.design.move(handles)
        first = next(iter(handles))
        mean = float(edge_lengths(self.design.vertices, self.design.topology).mean())
        x, y, z = handles[first]
        stretch = 1.0 + move * mean / math.hypot(x, y)
        self.places = {first: [stretch * x, stretch * y, z]}
        self.wall: list[float] = []
        self.processor: list[float] = []
        self.per_step: list[float] = []

    def run(self) -> None:
        """One edit."""
        self.answer, wall, processor = edited(self.design, self.places)
        steps = sum(run.iterations for run in self.answer.runs)
        self.wall.append(wall)
        self.processor.append(processor)
        self.per_step.append(sum(run.timings["total"] for run in self.answer.runs) / max(1, steps))

    def row(self) -> dict[str, object]:
        """Figures, least of the repetitions."""
        steps = sum(run.iterations for run in self.answer.runs)
        measures = self.answer.measures()
        return {
            "vertices": self.size,
            "formulation": self.formulation,
            "unknowns": sum(block.numel() for block in self.design.problem.blocks(self.design.problem.base).values()),
            "steps": steps,
            "steps_to_1e-6": steps_to_residual(self.design, self.places),
            "answer_s": min(self.wall),
            "answer_processor_s": min(self.processor),
            "step_s": min(self.per_step),
            "largest_residual": largest_residual(self.answer, self.answer.vertices),
            "saddle_side_share": measures["saddle_side_share"],
            "largest_handle_distance": measures["largest_handle_distance"],
            "paper_step_s": next(case.seconds for case in CASES.values() if case.size == self.size),
            "target_steps_per_s": SHAPES[self.size].target,
        }


HEADER = f"{'V':>5} {'formulation':12}{'unkn.':>7}{'steps':>6}{'to 1e-6':>8}{'answer':>8}{'proc.':>7}{'ms/step':>8}\
{'steps/s':>8}{'proc.':>6}{'spheres over':>13}{'paper over':>11}{'residual':>10}{'sides':>7}"


def report(row: dict[str, object], spheres: dict[str, object] | None) -> None:
    """One line of the table."""
    wall, processor = (row["steps"] / row[kind] for kind in ("answer_s", "answer_processor_s"))
    reached = row["steps_to_1e-6"]
    over = f"{row['answer_s'] / spheres['answer_s']:.2f}" if spheres else "-"
    print(
        f"{row['vertices']:>5} {row['formulation']:12}{row['unknowns']:>7}{row['steps']:>6}"
        f"{'never' if reached is None else reached:>8}{row['answer_s']:8.2f}{row['answer_processor_s']:7.2f}"
        f"{1e3 * row['step_s']:8.1f}{wall:8.1f}{processor:6.1f}{over:>13}{row['paper_step_s'] / row['step_s']:11.1f}"
        f"{row['largest_residual']:10.1e}{100 * row['saddle_side_share']:6.1f}%",
        end="",
    )
    target = row["target_steps_per_s"]
    if row["formulation"] == "spheres" and target:
        quick = reached is not None and reached <= MOST_STEPS
        print(f"  {verdict(wall >= target)} ({target:.0f}/s), {verdict(quick)} ({MOST_STEPS} steps)", end="")
    print(flush=True)


def verdict(met: bool) -> str:
    return "met" if met else "MISSED"


def edits(
    sizes: list[int], formulations: list[str], repeats: int, move: float, lifted_most: int
) -> list[dict[str, object]]:
    """All edits of all cases, formulations in turn."""
    rows = []
    for size in sizes:
        cases = [Edit(size, name, move) for name in formulations if name != "lifted" or size <= lifted_most]
        for _ in range(repeats):
            for case in cases:
                case.run()
        found = {case.formulation: case.row() for case in cases}
        for row in found.values():
            report(row, found.get("spheres"))
        rows += found.values()
    return rows


def table_20(figures: list[str], formulations: list[str], steps: int) -> list[dict[str, object]]:
    """Variables and seconds of a damped step from the first pull of the handles, beside the paper's."""
    print(f"\n{'ours':>44}{'paper':>30}\n{'fig.':>5}{'V':>6}{'E':>7}{'F':>7}{'stars':>7}  {'formulation':12}", end="")
    print(f"{'variables':>10}{'s/step':>8}{'variables':>11}{'s/step':>8}{'over ours':>11}")
    rows = []
    for figure in figures:
        case = CASES[figure]
        for formulation in formulations:
            if formulation == "lifted" and case.size > LIFTED_MOST:
                continue
            shape = SHAPES[case.size]
            design, handles = prepared(shape, formulation, most_steps=steps, on_polylines=case.on_polylines)
            design.move(handles)
            taken = sum(run.iterations for run in design.runs)
            seconds = sum(run.timings["total"] for run in design.runs) / taken
            variables = sum(block.numel() for block in design.problem.blocks(design.problem.base).values())
            mesh, stars = design.topology, design.stars.vertices.shape[0]
            rows.append({
                "figure": figure, "vertices": mesh.num_vertices, "edges": mesh.num_edges, "faces": mesh.num_faces,
                "stars": stars, "formulation": formulation, "variables": variables, "step_s": seconds,
                "paper_variables": 1000 * case.variables, "paper_step_s": case.seconds,
            })  # fmt: skip
            print(
                f"{figure:>5}{mesh.num_vertices:>6}{mesh.num_edges:>7}{mesh.num_faces:>7}{stars:>7}  "
                f"{formulation:12}{variables:>10}{seconds:8.3f}{case.variables:>10}k{case.seconds:8.2f}"
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
    document: dict[str, object] = {"torchfair": torchfair.__version__, "torch": torch.__version__}
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
