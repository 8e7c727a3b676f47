"""Seconds, memory and exponents from ten thousand vertices to a million: E, damped steps, files, commands.

Run from the repository root::

    python benchmarks/bench_scale.py --sizes 10000 100000 --tasks energy step read measure
    python benchmarks/bench_scale.py --sizes 10000 100000 --against ../before --json scale.json

Every task runs in a process of its own, so that its peak memory is its own. Times are processor time; the exponent is
that of the growth from the size before. With ``--against`` another source tree runs the same tasks, in turns.

=============  =========================================================================================
energy         E forward and backward: the least of some repetitions
step           a damped step on E, umbrella fairness and closeness (``torus_problem.py``) by conjugate gradients:
               the mean over some steps from the start, set-up left out; peak memory with set-up
setup          the index maps of that problem and its first linearisation
obj, ply       reading the bumpy torus of ``scale_mesh.py`` from a file (ASCII OBJ, binary PLY), ``plytext`` from
               ASCII PLY
measure, ...   the command on that file, imports included: ``measure``, ``diagnose``, ``reflect --no-pictures``,
               ``pictures`` (``reflect``), ``fair`` with at most ``--fair-steps`` steps in each of its runs
=============  =========================================================================================
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
COMMANDS = {
    "measure": ["measure"],
    "diagnose": ["diagnose"],
    "reflect": ["reflect", "--no-pictures"],
    "pictures": ["reflect"],
    "fair": ["fair", "--no-pictures"],
}
TASKS = ("energy", "step", "obj", "ply", "plytext", *COMMANDS)


# What runs in the processes. ----------------------------------------------------------------------------------------


def _report(**figures: float) -> None:
    import resource

    figures["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    print("FIGURES " + json.dumps(figures))


def energy(size: int, repeats: int) -> None:
    """E forward and backward."""
    import time

    import torch
    from scale_mesh import bumpy_torus

    from torchfair import Topology
    from torchfair.energies import normal_variation

    points, faces = bumpy_torus(size)
    topology, vertices = Topology.from_faces(faces), torch.from_numpy(points).requires_grad_()
    seconds = []
    for _ in range(repeats + 1):
        vertices.grad, start = None, time.process_time()
        normal_variation(vertices, topology).backward()
        seconds.append(time.process_time() - start)
    _report(seconds=min(seconds[1:]), first=seconds[0])


def step(size: int, repeats: int) -> None:
    """Damped steps by conjugate gradients."""
    import time

    from torus_problem import torus_problem

    from torchfair.projection import GuidedProjection, ProjectionSettings, init
    from torchfair.projection import step as damped_step

    start, terms = torus_problem(size)
    before = time.process_time()
    settings = ProjectionSettings(solver="cg")
    problem = GuidedProjection(start, terms, solver="cg")
    state, setup = init(problem, start, settings), 0.0
    inner = 0
    for number in range(repeats + 1):
        if number == 1:  # the first step makes index maps
            setup, before = time.process_time() - before, time.process_time()
            inner = 0
        state, record = damped_step(problem, state)
        inner += record.inner_iterations
    seconds = (time.process_time() - before) / repeats
    _report(seconds=seconds, setup=setup, inner=inner / repeats, merit=state.merit)


def read(path: str) -> None:
    """Reading a file."""
    import time

    import torchfair.io

    start = time.process_time()
    torchfair.io.load_mesh(path)
    _report(seconds=time.process_time() - start)


# What starts them. --------------------------------------------------------------------------------------------------


def run(tree: Path, work: list[str], threads: int) -> dict[str, float]:
    """Figures of one task in a process of its own, with the library of a source tree."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tree), str(HERE)]), "OMP_NUM_THREADS": str(threads)}
    if work[0] == "command":
        process = subprocess.Popen(
            [sys.executable, "-m", "torchfair", *work[1:]],
            cwd=tree,  # python -m looks there first
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        _, status, usage = os.wait4(process.pid, 0)
        seconds, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e9
        return {"seconds": seconds, "peak_gb": peak, "code": float(os.waitstatus_to_exitcode(status))}
    ended = subprocess.run(
        [sys.executable, str(HERE / "bench_scale.py"), "--work", *work], env=environment, capture_output=True, text=True
    )
    lines = [line for line in ended.stdout.splitlines() if line.startswith("FIGURES ")]
    if not lines:
        raise SystemExit(f"{' '.join(work)} failed in {tree}:\n{ended.stderr[-2000:]}")
    figures: dict[str, float] = json.loads(lines[-1].removeprefix("FIGURES "))
    return figures


def write_files(size: int, folder: Path) -> None:
    """The bumpy torus as OBJ and PLY, by this tree."""
    code = (
        "import sys, torch, torchfair.io; from scale_mesh import bumpy_torus; "
        "from torchfair import Topology; p, f = bumpy_torus(int(sys.argv[1])); "
        "[torchfair.io.save_mesh(f'{sys.argv[2]}/{sys.argv[1]}.{e}', torch.from_numpy(p), Topology.from_faces(f), "
        "binary=e == 'ply') for e in ('obj', 'ply', 'text.ply')]"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(HERE.parent), str(HERE)])}
    subprocess.run([sys.executable, "-c", code, str(size), str(folder)], env=environment, check=True)


def work_of(task: str, size: int, folder: Path, repeats: int, fair_steps: int) -> list[str]:
    """Arguments of the process of a task."""
    if task in ("energy", "step"):
        return [task, str(size), str(repeats)]
    if task in ("obj", "ply", "plytext"):
        return ["read", str(folder / f"{size}.{'text.ply' if task == 'plytext' else task}")]
    extra = ["-o", str(folder / "fair.ply"), "--force", "--iterations", str(fair_steps)] if task == "fair" else []
    extra += ["--output", str(folder / "reflect"), "--force"] if task == "pictures" else []
    return ["command", COMMANDS[task][0], str(folder / f"{size}.ply"), *COMMANDS[task][1:], *extra]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[10_000, 30_000, 100_000, 300_000])
    parser.add_argument("--tasks", nargs="+", default=["energy", "step", "obj", "ply", "measure"], choices=TASKS)
    parser.add_argument("--against", type=Path, help="another source tree to compare with")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5, help="repetitions of E, damped steps (default: %(default)s)")
    parser.add_argument("--fair-steps", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    trees = {"this": HERE.parent} | ({"other": options.against.resolve()} if options.against else {})
    rows: list[dict[str, Any]] = []
    print(f"{'task':9}{'V':>9} {'tree':6}{'seconds':>10}{'exponent':>10}{'peak GB':>9}  more")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        last: dict[tuple[str, str], tuple[int, float]] = {}
        for size in options.sizes:
            if set(options.tasks) - {"energy", "step"}:
                write_files(size, folder)
            for task in options.tasks:
                for label, tree in trees.items():
                    work = work_of(task, size, folder, options.repeats, options.fair_steps)
                    figures = run(tree, work, options.threads)
                    rows.append({"task": task, "vertices": size, "tree": label, **figures})
                    _print(rows[-1], last)
    if options.json:
        machine = {"python": platform.python_version(), "processors": os.cpu_count(), "load": os.getloadavg()}
        document = {"threads": options.threads, "machine": machine, "rows": rows}
        options.json.write_text(json.dumps(document, indent=2) + "\n")


def _print(row: dict[str, Any], last: dict[tuple[str, str], tuple[int, float]]) -> None:
    more = dict(row)
    task, size, tree, seconds, peak = (more.pop(k) for k in ("task", "vertices", "tree", "seconds", "peak_gb"))
    key = (str(task), str(tree))
    exponent = ""
    if key in last and last[key][0] != size:
        before, time = last[key]
        exponent = f"{math.log(float(str(seconds)) / time) / math.log(int(str(size)) / before):.2f}"
    last[key] = (int(str(size)), float(str(seconds)))
    rest = ", ".join(f"{name} {value:.4g}" for name, value in more.items())
    print(f"{task:9}{size:>9} {tree:6}{seconds:>10.3f}{exponent:>10}{peak:>9.2f}  {rest}", flush=True)


WORK: dict[str, Callable[[list[str]], None]] = {
    "energy": lambda given: energy(int(given[0]), int(given[1])),
    "step": lambda given: step(int(given[0]), int(given[1])),
    "read": lambda given: read(given[0]),
}

if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        WORK[sys.argv[2]](sys.argv[3:])
    else:
        main()
