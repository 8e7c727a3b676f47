"""Guided projection and ``scipy.optimize.least_squares`` side by side on one problem.

Run ``python benchmarks/bench_least_squares.py [--sizes 2784 10000] [--threads 2] [--json FILE]``.

Both lower the same merit, E of a noisy torus (see ``torus_problem.py``), from the same start. SciPy gets our
element residuals and our sparse Jacobians; the smoothed absolute value ``sqrt(s^2 + eps^2) - eps`` is half the
square of the smooth residual ``s sqrt(2 / (sqrt(s^2 + eps^2) + eps))``, so that the merits agree to rounding
(checked at every evaluation). It runs twice: as it comes, and with the inner iterations of LSMR limited, which
its documentation leaves to the user and which helps it much here.

Runs are repeated in turn; since each takes the same path every time, the least time at which a merit was
reached counts. Ratios are our time to SciPy's final merit over SciPy's time to it, by processor time and by
wall time: on a busy machine the former tells more.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # SciPy's vectors are short: on a busy machine threads harm it

import numpy as np
import scipy
import scipy.sparse as sp
import torch
from scipy.optimize import least_squares
from torus_problem import SMOOTHING, torus_problem

import torchfair
from torchfair.linear import RslabDirect
from torchfair.projection import GuidedProjection, ProjectionSettings
from torchfair.projection.evaluation import Evaluation

TARGET = 0.5
LSMR = {"SciPy": {}, "SciPy, LSMR <= 50": {"maxiter": 50}}
Path_ = list[tuple[float, float, float]]  # wall seconds, processor seconds, merit


class Problem:
    """The residuals and Jacobians of the engine in the form that SciPy takes, with a record of merits."""

    def __init__(self, problem: GuidedProjection) -> None:
        self.structure, self.layout = problem.structure, problem.layout
        self._point: np.ndarray | None = None
        self.begin = (time.perf_counter(), time.process_time())
        self.path: Path_ = []

    def _evaluate(self, x: np.ndarray) -> tuple[Evaluation, torch.Tensor, torch.Tensor]:
        if self._point is None or not np.array_equal(self._point, x):
            self._point = x.copy()
            self._evaluation = self.structure.evaluate(self.layout.unflatten(torch.from_numpy(x)))
        bend = self._evaluation.values[0][:, 0]
        return self._evaluation, bend, torch.sqrt(bend.square() + SMOOTHING**2)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Residuals whose half sum of squares is the merit."""
        evaluation, bend, smooth = self._evaluate(x)
        assert evaluation.affine is not None
        result = torch.cat([bend * torch.sqrt(2.0 / (smooth + SMOOTHING)), evaluation.affine])
        merit, engines = 0.5 * float(result @ result), float(evaluation.merits)
        if abs(merit - engines) > 1e-12 * merit:
            raise AssertionError(f"the merits differ: {merit} and {engines}")
        self.path.append((time.perf_counter() - self.begin[0], time.process_time() - self.begin[1], merit))
        return result.numpy()

    def jacobian(self, x: np.ndarray) -> sp.csr_matrix:
        """Derivatives: ours, rescaled from the reweighted residual to that of :meth:`residual`."""
        evaluation, _, smooth = self._evaluate(x)
        system = self.structure.linearise(evaluation)
        system.jacobians[0] *= torch.sqrt((smooth + SMOOTHING) / (2.0 * smooth))
        matrix = system.jacobian
        parts = (matrix.values().numpy(), matrix.col_indices().numpy(), matrix.crow_indices().numpy())
        return sp.csr_matrix(parts, (matrix.shape[0], matrix.shape[1]))


def run_scipy(size: int, evaluations: int, options: dict[str, int]) -> Path_:
    start, terms = torus_problem(size)
    problem = Problem(GuidedProjection(start, terms))
    x = problem.layout.flatten(start).numpy()
    with torch.no_grad():
        least_squares(
            problem.residual,
            x,
            jac=problem.jacobian,
            method="trf",
            tr_solver="lsmr",
            tr_options=options,
            max_nfev=evaluations,
        )
    return problem.path


def run_ours(size: int, solver: str, steps: int) -> Path_:
    start, terms = torus_problem(size)
    begin = (time.perf_counter(), time.process_time())
    settings = ProjectionSettings(
        max_iterations=steps, initial_damping=0.1, damping_scale="identity", merit_tolerance=1e-6, patience=4
    )
    path: Path_ = []
    GuidedProjection(start, terms, solver=solver).solve(
        start,
        settings=settings,
        callback=lambda r: path.append((time.perf_counter() - begin[0], time.process_time() - begin[1], r.merit)),
    )
    return path


def lowest_so_far(path: Path_) -> Path_:
    merits = np.minimum.accumulate([merit for _, _, merit in path])
    return [(wall, processor, float(m)) for (wall, processor, _), m in zip(path, merits, strict=True)]


def fastest(paths: list[Path_]) -> Path_:
    """Least times over repetitions of the same path."""
    return [(min(p[0] for p in points), min(p[1] for p in points), points[0][2]) for points in zip(*paths, strict=True)]


def time_to(path: Path_, merit: float) -> tuple[float, float]:
    """Wall and processor seconds until ``merit`` was reached; infinite if it was not."""
    return next(((wall, processor) for wall, processor, m in path if m <= merit), (float("inf"), float("inf")))


def compare(size: int, evaluations: int, steps: int, repeats: int) -> dict[str, Any]:
    solvers = ["cg", "rslab" if RslabDirect.available() else "scipy"]
    jobs: dict[str, Callable[[], Path_]] = {
        **{name: partial(run_scipy, size, evaluations, options) for name, options in LSMR.items()},
        **{f"torchfair, {solver}": partial(run_ours, size, solver, steps) for solver in solvers},
    }
    runs: dict[str, list[Path_]] = {name: [] for name in jobs}
    for _ in range(repeats):
        for name, job in jobs.items():
            runs[name].append(job())
    paths = {name: lowest_so_far(fastest(repeated)) for name, repeated in runs.items()}
    ratios = {}
    for peer in LSMR:
        final = paths[peer][-1][2]
        theirs = time_to(paths[peer], final)
        for name in paths:
            if name not in LSMR:
                ours = time_to(paths[name], final)
                ratios[f"{name} / {peer}"] = {"wall": ours[0] / theirs[0], "processor": ours[1] / theirs[1]}
    return {"vertices": torus_problem(size)[0]["vertices"].shape[0], "paths": paths, "ratios": ratios}


def report(result: dict[str, Any]) -> None:
    paths, ratios = result["paths"], result["ratios"]
    print(f"\nV = {result['vertices']}: merit over time")
    print(f"{'processor s':>12}", *(f"{name:>22}" for name in paths))
    last = max(path[-1][1] for path in paths.values())
    for moment in last * np.geomspace(1 / 64, 1, 13):
        cells = []
        for path in paths.values():
            reached = [m for _, processor, m in path if processor <= moment]
            cells.append(f"{reached[-1]:22.4f}" if reached else f"{'':22}")
        print(f"{moment:12.2f}", *cells)
    for name, path in paths.items():
        wall, processor = time_to(path, path[-1][2])
        print(f"{name:22} final merit {path[-1][2]:10.4f} after {wall:7.2f} s wall, {processor:7.2f} s processor")
    for name, ratio in ratios.items():
        verdict = "met" if ratio["processor"] <= TARGET else "MISSED"
        print(f"{name:42} time ratio {ratio['wall']:5.2f} wall, {ratio['processor']:5.2f} processor  {verdict}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[2784, 10000])
    parser.add_argument("--evaluations", type=int, default=40, help="of SciPy (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=30, help="damped steps of ours (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=2, help="runs of each (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    print(f"{options.threads} thread(s), load {os.getloadavg()[0]:.1f}")
    results = []
    for size in options.sizes:
        results.append(compare(size, options.evaluations, options.steps, options.repeats))
        report(results[-1])
    if options.json:
        versions = {module.__name__: module.__version__ for module in (torchfair, torch, np, scipy)}
        machine = {"python": platform.python_version(), "processors": os.cpu_count(), "load": os.getloadavg()}
        document = {"threads": options.threads, "target": TARGET, "machine": machine | versions, "results": results}
        options.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
