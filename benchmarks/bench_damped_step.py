"""Where the time of one damped step goes: Jacobian, assembly, factorisation, solve, merit.

Run ``python benchmarks/bench_damped_step.py [--sizes 2784 10000 50000 200000] [--threads 2] [--json FILE]``.

The engine lowers E of a noisy torus (see ``torus_problem.py``) for a few steps, several times from the same
start, all linear solvers in turn. Every figure is the least of the repetitions of one step, then the median of
the steps, in milliseconds. Processor time beside wall time tells how busy the machine was otherwise: on a quiet
one they agree, or wall time is the smaller where two threads work.

=============  =========================================================================================
Jacobian       residuals weighted, element Jacobians, gradient
assembly       direct: the normal matrix; iterative: the stored Jacobian, its transpose, diagonal blocks
factor, solve  direct: factorisation, then substitution; iterative: all inner iterations
merit          residuals of the trial state (twice where the step is extrapolated)
corrected      the whole of a step that is tried again with a second-order correction
other          everything else in the engine
outside        share of a direct step outside factorisation and solve (target: at most 25 %); for the
               iterative solver, its iterations
=============  =========================================================================================
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import resource
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import scipy
import torch
from torch import Tensor
from torus_problem import torus_problem

import torchfair
from torchfair.linear import (
    ConjugateGradients,
    Factor,
    LinearSolver,
    PardisoDirect,
    RslabDirect,
    ScipyDirect,
    Solution,
    System,
)
from torchfair.projection import GuidedProjection, IterationRecord, ProjectionSettings
from torchfair.projection.evaluation import Evaluation
from torchfair.projection.linear_system import LinearSystem
from torchfair.projection.proposal import descend
from torchfair.projection.system import Structure

PARTS = ("jacobian", "assembly", "factor", "solve", "merit", "other", "whole")
COLUMNS = (*PARTS, "corrected")
TARGETS = {("rslab", 2784): 60.0, ("rslab", 10000): 250.0}  # milliseconds of the whole step
TARGETS |= {("cg", 2784): 20.0, ("cg", 10000): 120.0, ("cg", 50000): 300.0, ("cg", 200000): 3000.0}
SOLVERS = {"rslab": RslabDirect, "pardiso": PardisoDirect, "scipy": ScipyDirect, "cg": ConjugateGradients}
LARGEST = {"rslab": 60_000, "pardiso": 60_000, "scipy": 12_000, "cg": 10**9}  # sizes at which each solver is tried

T = TypeVar("T")
Seconds = tuple[float, float]  # wall, processor


def now() -> Seconds:
    return time.perf_counter(), time.process_time()


class Clock:
    """Adds up the time of the parts of each step."""

    def __init__(self) -> None:
        self.steps: list[dict[str, Seconds]] = []
        self.begin()

    def begin(self) -> None:
        """Starts a step."""
        self._parts: dict[str, Seconds] = defaultdict(lambda: (0.0, 0.0))
        self._start = now()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Counts the time of its body."""
        start = now()
        yield
        end, sum_ = now(), self._parts[name]
        self._parts[name] = (sum_[0] + end[0] - start[0], sum_[1] + end[1] - start[1])

    def timed(self, name: str, function: Callable[..., T]) -> Callable[..., T]:
        """The function, with its time counted."""

        def call(*arguments: object) -> T:
            with self.part(name):
                return function(*arguments)

        return call

    def end_step(self, record: IterationRecord) -> None:
        """Closes a step; callback of the engine."""
        end, known = now(), list(self._parts.values())
        whole = (end[0] - self._start[0], end[1] - self._start[1])
        self._parts["whole"] = whole
        self._parts["other"] = (whole[0] - sum(k[0] for k in known), whole[1] - sum(k[1] for k in known))
        if record.iteration:
            self.steps.append(dict(self._parts))
        self.begin()


class Timed:
    """A linear solver whose assembly, factorisation and substitution are timed apart."""

    def __init__(self, solver: LinearSolver, clock: Clock) -> None:
        self.name, self.inexact, self.prepare = solver.name, solver.inexact, solver.prepare
        self._solver, self._clock = solver, clock

    def factorise(self, system: System, damping: Tensor) -> TimedFactor:
        """The factor, with what it is made of computed before."""
        assert isinstance(system, LinearSystem)
        with self._clock.part("assembly"):
            if self.inexact:
                system.jacobian, system.diagonal_blocks  # noqa: B018  (stored now, used by the solver)
            else:
                system.lower_values  # noqa: B018
        with self._clock.part("factor"):
            return TimedFactor(self._solver.factorise(system, damping), self._clock)


class TimedFactor:
    """A factor whose solutions are timed."""

    def __init__(self, factor: Factor, clock: Clock) -> None:
        self._factor, self._clock = factor, clock

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        """The solution, as good as a step needs it."""
        with self._clock.part("solve"):
            return descend(self._factor, right, accuracy)


class Case:
    """One size with one solver, prepared to be run again and again."""

    def __init__(self, name: str, size: int, steps: int) -> None:
        self.name, self.size = name, size
        self.clock = Clock()
        self.runs: list[list[dict[str, Seconds]]] = []
        self.inner: list[int] = []
        solver = Timed(SOLVERS[name](), self.clock)
        self.start, terms = torus_problem(size)
        begin = now()
        self.problem = GuidedProjection(self.start, terms, solver=solver)
        self._prepare()
        self.problem.prepare()
        end = now()
        self.setup = (end[0] - begin[0], end[1] - begin[1])
        self._time(self.problem.structure)
        # Tolerances are off: every run makes the same steps, all with the first accuracy of the inner iteration.
        self.settings = ProjectionSettings(
            max_iterations=steps,
            initial_damping=0.1,
            damping_scale="identity",
            merit_tolerance=0.0,
            patience=10**6,
            least_uncorrected_gain=-math.inf,
        )
        self.corrected: list[list[dict[str, Seconds]]] = []

    def _prepare(self) -> None:
        """Builds the index maps, which the engine would do in the first step."""
        structure = self.problem.structure
        system = structure.linearise(self.start)
        system.gradient  # noqa: B018
        if self.name == "cg":
            system.jacobian, system.diagonal_blocks  # noqa: B018
        else:
            system.lower_values  # noqa: B018

    def _time(self, structure: Structure) -> None:
        linearise = structure.linearise

        def all_of_it(state: Mapping[str, Tensor] | Evaluation) -> LinearSystem:
            system = linearise(state)
            system.gradient  # noqa: B018
            return system

        structure.linearise = self.clock.timed("jacobian", all_of_it)  # type: ignore[method-assign]
        structure.evaluate = self.clock.timed("merit", structure.evaluate)  # type: ignore[method-assign]

    def run(self) -> None:
        """A few damped steps from the start."""
        self.clock.steps = []
        always = replace(self.settings, least_uncorrected_gain=math.inf)
        self.problem.solve(self.start, settings=always, callback=self.clock.end_step)
        self.corrected.append(self.clock.steps)
        self.clock.steps = []
        result = self.problem.solve(self.start, settings=self.settings, callback=self.clock.end_step)
        self.runs.append(self.clock.steps)
        self.inner = [record.inner_iterations for record in result.history[1:]]
        self.merit = result.merit

    def result(self) -> dict[str, Any]:
        """Least of the runs for each step, then the median of the steps; milliseconds."""
        row: dict[str, Any] = {"vertices": self.start["vertices"].shape[0], "solver": self.name}
        for index, kind in enumerate(("wall_ms", "processor_ms")):
            row[kind] = {part: 1e3 * _median(self.runs, part, index) for part in PARTS}
            row[kind]["corrected"] = 1e3 * _median(self.corrected, "whole", index)
        row["setup_s"] = dict(zip(("wall", "processor"), self.setup, strict=True))
        row["inner_iterations"], row["merit"] = self.inner, self.merit
        row["peak_memory_gib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        row["target_ms"] = TARGETS.get((self.name, self.size))
        return row


def _median(runs: list[list[dict[str, Seconds]]], part: str, index: int) -> float:
    steps = zip(*runs, strict=True)  # the same step of every run
    return statistics.median(min(step.get(part, (0.0, 0.0))[index] for step in same) for same in steps)


def report(row: dict[str, Any]) -> None:
    wall, processor = row["wall_ms"], row["processor_ms"]
    print(f"{row['vertices']:>7} {row['solver']:9}", *(f"{wall[part]:9.2f}" for part in COLUMNS), end="")
    outside = 1.0 - (processor["factor"] + processor["solve"]) / processor["whole"]
    inner = statistics.median(row["inner_iterations"])
    print(f"{100 * outside:6.0f} %" if row["solver"] != "cg" else f"{inner:5.0f} it", end="")
    print(f"{row['setup_s']['wall']:9.2f}{row['peak_memory_gib']:7.2f}", end="")
    target = row["target_ms"]
    print("" if target is None else f"{target:8.0f} {'met' if wall['whole'] <= target else 'MISSED'}")
    print(f"{'processor':>17}", *(f"{processor[part]:9.2f}" for part in COLUMNS), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[2784, 10000, 50000, 200000])
    parser.add_argument("--solvers", nargs="+", default=list(SOLVERS), choices=list(SOLVERS))
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--steps", type=int, default=6, help="damped steps in each run (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=5, help="runs of each case (default: %(default)s)")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    print(f"{options.threads} thread(s), load {os.getloadavg()[0]:.1f}; milliseconds")
    heads = f"{'outside':>8}{'setup s':>9}{'GiB':>7}{'target':>8}"
    print(f"{'V':>7} {'solver':9}", *(f"{part:>9}" for part in COLUMNS), heads, sep=" ")
    rows = []
    for size in options.sizes:
        names = [name for name in options.solvers if size <= LARGEST[name]]
        cases = [
            Case(name, size, options.steps) for name in names if getattr(SOLVERS[name], "available", lambda: True)()
        ]
        for _ in range(options.repeats):
            for case in cases:
                if case.name != "scipy" or not case.runs:  # slow, so once is enough
                    case.run()
        for case in cases:
            rows.append(case.result())
            report(rows[-1])
    if options.json:
        versions = {module.__name__: module.__version__ for module in (torchfair, torch, np, scipy)}
        machine = {"python": platform.python_version(), "processors": os.cpu_count(), "load": os.getloadavg()}
        document = {"threads": options.threads, "machine": machine | versions, "rows": rows}
        options.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
