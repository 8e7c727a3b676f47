"""Not in the paper: many meshes by many settings on the workers of Dask, resumable, with all results in one table.

Every mesh is faired (``torchfair.formfinding.minimise_normal_variation``) with every combination of the settings that
``--vary`` gives. Jobs run in processes of a Dask cluster: by default one of two on this machine, with ``--scheduler
ADDRESS`` one that is there already, on as many machines as it has (torchfair has to be installed on all; meshes go
along with the jobs, so that no disk has to be shared).

Each job that is done is a file in ``jobs/``, named after its mesh, settings and version. ``--resume`` takes what is
there and does the rest: after Ctrl-C, after a failure, or with more meshes and settings. ``table.csv`` has a row for
each job; jobs that failed say why.

Another job than fairing is another function in place of ``solve``.
"""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import json
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology, TorchfairError, __version__
from torchfair.errors import SettingsError
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.io import atomic_write_text, load_mesh, to_json
from torchfair.settings import fields_of
from torchfair.settings.files import with_fields
from torchfair.shapes import builtin_mesh

NAME = "parameter_study"
TABLE, FOLDER = "table.csv", "jobs"
EXAMPLE = "example:"
MEASURES = (
    "faces", "normal_variation_before", "normal_variation", "energy_over_curvature", "largest_distance_relative",
    "largest_planarity_of_all", "smallest_angle_degrees", "iterations", "holds", "seconds",
)  # fmt: skip

Mesh = tuple[Tensor, Topology]
Row = dict[str, Any]


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    meshes: tuple[str, ...] = setting(("example:roof", "example:hybrid_roof"), "mesh files, or example:NAME")
    vary: tuple[str, ...] = setting(
        ("fairness_weight=0.01,0.1", "distance_limit=0.01,0.1"), "fields of FairSettings and their values"
    )
    workers: int = setting(2, "processes of the cluster on this machine", least=1)
    scheduler: str = setting("", "address of a Dask scheduler that runs already, such as tcp://host:8786")
    resume: bool = setting(False, "take the jobs that are done in the output folder, and do the rest")

    @property
    def replaces(self) -> bool:
        """Whether results that are there already may be replaced."""
        return self.force or self.resume


@dataclass(frozen=True)
class Job:
    """One mesh with one choice of settings.

    Attributes:
        mesh: Its name.
        chosen: Values by field, as text.
        key: Of mesh, settings and version; the name of its file.
    """

    mesh: str
    chosen: tuple[tuple[str, str], ...]
    key: str


# ---- what is to be done --------------------------------------------------------------------------------


def read(name: str) -> Mesh:
    """A mesh file, or a built-in example."""
    if not name.startswith(EXAMPLE):
        mesh = load_mesh(name)
        return mesh.vertices, mesh.topology
    return builtin_mesh(name.removeprefix(EXAMPLE))


def choices(vary: Sequence[str]) -> list[tuple[tuple[str, str], ...]]:
    """All combinations of values; each is tried, so that a wrong one ends the study before it begins."""
    columns = []
    for words in vary:
        field, equals, values = words.partition("=")
        if not equals or not values or field not in fields_of(FairSettings):
            known = ", ".join(fields_of(FairSettings))
            raise TorchfairError(f"--vary {words}: expected FIELD=VALUE,VALUE with one of the fields {known}")
        columns.append([(field, value) for value in values.split(",")])
    found = list(itertools.product(*columns))
    for chosen in found:
        settings_of(chosen)
    return found


def settings_of(chosen: Sequence[tuple[str, str]]) -> FairSettings:
    """The settings that differ from the default in some fields."""
    fields = fields_of(FairSettings)
    try:
        return with_fields(FairSettings(), {field: fields[field].parse(value) for field, value in chosen})
    except (ValueError, SettingsError) as error:
        raise TorchfairError(f"--vary {' '.join('='.join(pair) for pair in chosen)}: {error}") from None


def key_of(mesh: Mesh, chosen: Sequence[tuple[str, str]]) -> str:
    """The same for the same positions, faces, settings and version of torchfair, whatever the file is called."""
    digest = hashlib.sha256(mesh[0].numpy().tobytes() + mesh[1].fingerprint.encode())
    digest.update(to_json([__version__, settings_of(chosen)]).encode())
    return digest.hexdigest()[:24]


def solve(mesh: Mesh, chosen: Sequence[tuple[str, str]]) -> Row:
    """One job, wherever it runs; what fails is told, so that the others go on."""
    torch.set_num_threads(1)
    began = time.perf_counter()
    try:
        found = minimise_normal_variation(*mesh, settings=settings_of(chosen))
    except TorchfairError as error:
        return {"error": " ".join(str(error).split())}
    after = {name: found.after[name] for name in MEASURES if name in found.after}
    return {
        **after,
        "faces": mesh[1].num_faces,
        "normal_variation_before": found.before["normal_variation"],
        "iterations": sum(len(run.history) for run in found.runs),
        "holds": found.holds,
        "seconds": round(time.perf_counter() - began, 3),
    }


# ---- who does it ---------------------------------------------------------------------------------------


def done_on_workers(config: Config, meshes: dict[str, Mesh], jobs: Sequence[Job]) -> Iterator[tuple[Job, Row]]:
    """Jobs with their results, as they come in; each mesh is sent once."""
    try:
        import cloudpickle
        from dask.distributed import Client, as_completed
    except ImportError as error:
        raise TorchfairError(f"a study needs Dask: pip install 'torchfair[study]' ({error})") from None
    if __name__ != "__main__":  # workers need not find this file
        cloudpickle.register_pickle_by_value(sys.modules[__name__])
    with _cluster(config) as where, Client(where) as client:
        sent = {name: client.scatter(mesh, hash=False) for name, mesh in meshes.items()}
        futures = {client.submit(solve, sent[job.mesh], job.chosen, key=job.key): job for job in jobs}
        try:
            for future in as_completed(futures):
                yield futures[future], _result(future)
        finally:
            client.cancel(list(futures))


def _cluster(config: Config) -> AbstractContextManager[Any]:
    """The scheduler that is there, or processes of this machine, which end with the study."""
    from dask.distributed import LocalCluster

    if config.scheduler:
        return nullcontext(config.scheduler)
    return LocalCluster(
        n_workers=config.workers, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
    )


def _result(future: Any) -> Row:
    """Of a job that ended; a worker that died, say for want of memory, fails its job only."""
    error = future.exception()
    return future.result() if error is None else {"error": f"{type(error).__name__}: {' '.join(str(error).split())}"}


# ---- the study -----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Does what is not done yet, and writes the table, after Ctrl-C with what is there."""
    meshes = {name: read(name) for name in dict.fromkeys(config.meshes)}
    jobs = [Job(name, chosen, key_of(mesh, chosen)) for name, mesh in meshes.items() for chosen in choices(config.vary)]
    folder = results.folder / FOLDER
    folder.mkdir(exist_ok=True)
    rows: dict[str, Row] = {}
    if config.resume:
        rows = {job.key: json.loads(_file(folder, job).read_text()) for job in jobs if _file(folder, job).exists()}
    reused, interrupted = len(rows), False
    missing = list({job.key: job for job in jobs if job.key not in rows}.values())
    try:
        for job, row in done_on_workers(config, meshes, missing) if missing else ():
            rows[job.key] = row
            if "error" not in row:  # what failed is tried again
                atomic_write_text(_file(folder, job), to_json(row), overwrite=True)
            print(f"{len(rows)} of {len(jobs)}: {_called(job)}: {row.get('error') or _told(row)}", flush=True)
    except KeyboardInterrupt:
        interrupted = True
    results.text(TABLE, table(jobs, rows))
    failed = sum("error" in row for row in rows.values())
    return {"jobs": len(jobs), "reused": reused, "failed": failed, "done": len(rows) - failed,
        "interrupted": interrupted}  # fmt: skip


def _file(folder: Path, job: Job) -> Path:
    return folder / f"{job.key}.json"


def _called(job: Job) -> str:
    return " ".join([job.mesh, *("=".join(pair) for pair in job.chosen)])


def _told(row: Row) -> str:
    return f"E {row['normal_variation_before']:.4g} -> {row['normal_variation']:.4g}"


def table(jobs: Sequence[Job], rows: dict[str, Row]) -> str:
    """Comma-separated values: a row for each job that ended, in the order of meshes and settings."""
    text = io.StringIO()
    fields = [field for field, _ in jobs[0].chosen]
    writer = csv.DictWriter(text, ["mesh", *fields, *MEASURES, "error"], restval="", lineterminator="\n")
    writer.writeheader()
    for job in jobs:
        if job.key in rows:
            writer.writerow({"mesh": job.mesh, **dict(job.chosen), **rows[job.key]})
    return text.getvalue()


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the experiment with command-line arguments and returns its exit code."""
    return run_experiment(NAME, __doc__, Config, experiment, (TABLE,), arguments)


if __name__ == "__main__":
    sys.exit(main())
