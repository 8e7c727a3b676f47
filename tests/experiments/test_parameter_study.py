"""Parameter studies on a cluster of two processes: the same numbers as here, nothing twice, failures by themselves."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch
from helpers import wavy_grid

from torchfair import Topology
from torchfair.io import save_mesh

Run = Callable[..., dict[str, Any]]
VARY = ("--vary", "fairness_weight=0.01,0.2", "boundary=fixed")
dask = pytest.mark.filterwarnings("ignore")  # of Dask's own


@pytest.fixture
def meshes(tmp_path: Path) -> list[str]:
    """Two that can be faired, and one with a face without area."""
    save_mesh(tmp_path / "a.obj", *wavy_grid(6, 6))
    save_mesh(tmp_path / "b.obj", *wavy_grid(5, 7, triangles=True, seed=3))
    flat = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], dtype=torch.float64)
    save_mesh(tmp_path / "flat.obj", flat, Topology.from_faces([[0, 1, 2], [0, 2, 3]]))
    return [str(tmp_path / f"{name}.obj") for name in ("a", "b", "flat")]


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="") as file:
        return [{name: value for name, value in row.items() if name != "seconds"} for row in csv.DictReader(file)]


@dask
@pytest.mark.slow
def test_two_processes_find_what_one_finds_and_nothing_is_done_twice(
    run: Run, script: Callable[[str], ModuleType], meshes: list[str], tmp_path: Path
) -> None:
    pytest.importorskip("distributed")
    study, out = script("parameter_study"), tmp_path / "out"
    report = run("parameter_study", "--meshes", *meshes, *VARY)
    assert (report["jobs"], report["reused"], report["done"], report["failed"]) == (6, 0, 4, 2)
    rows = rows_of(out)
    assert [(row["mesh"], row["fairness_weight"]) for row in rows] == [(m, w) for m in meshes for w in ("0.01", "0.2")]
    for row in rows[:4]:
        chosen = (("fairness_weight", row["fairness_weight"]), ("boundary", "fixed"))
        expected = study.solve(study.read(row["mesh"]), chosen)
        assert {name: str(value) for name, value in expected.items() if name != "seconds"}.items() <= row.items()
    assert all("area" in row["error"] for row in rows[4:])
    files = sorted((out / "jobs").iterdir())
    assert len(files) == 4
    files[1].unlink()
    more = ("--vary", "fairness_weight=0.2,0.05,0.01", "boundary=fixed", "--resume")
    again = run("parameter_study", "--meshes", *meshes, *more)
    assert (again["jobs"], again["reused"], again["done"], again["failed"]) == (9, 3, 6, 3)
    assert [row for row in rows_of(out) if row in rows] == [rows[i] for i in (1, 0, 3, 2, 5, 4)]


def test_resuming_a_study_that_is_done_needs_no_cluster(
    run: Run, script: Callable[[str], ModuleType], meshes: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = script("parameter_study"), tmp_path / "out"
    (out / "jobs").mkdir(parents=True)
    (key,) = (study.key_of(study.read(meshes[0]), chosen) for chosen in study.choices(["fairness_weight=0.1"]))
    row = {"normal_variation": 2.0, "normal_variation_before": 3.0, "holds": True}
    (out / "jobs" / f"{key}.json").write_text(json.dumps(row))
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    options = ("--meshes", meshes[0], "--vary", "fairness_weight=0.1")
    assert run("parameter_study", *options, "--resume")["reused"] == 1
    assert rows_of(out)[0]["normal_variation"] == "2.0"
    run("parameter_study", *options, "--force", code=2)  # Dask is not there


def test_keys_tell_meshes_and_settings_apart(script: Callable[[str], ModuleType], meshes: list[str]) -> None:
    study = script("parameter_study")
    first, second = study.read(meshes[0]), study.read(meshes[1])
    moved = first[0].clone()
    moved[0, 0] = torch.nextafter(moved[0, 0], moved[0, 0] + 1)
    chosen = study.choices(["fairness_weight=0.1,0.2", "boundary=fixed,glide"])
    keys = {study.key_of(mesh, choice) for mesh in (first, second, (moved, first[1])) for choice in chosen}
    assert len(keys) == 12
    assert study.key_of(first, (("fairness_weight", "0.10"),)) == study.key_of(first, (("fairness_weight", "1e-1"),))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--vary", "fairness=1"), "--vary fairness=1: expected FIELD=VALUE,VALUE with one of the fields"),
        (("--vary", "fairness_weight"), "--vary fairness_weight: expected FIELD=VALUE"),
        (("--vary", "fairness_weight=-1"), "--vary fairness_weight=-1: weights must be at least 0"),
        (("--vary", "boundary=glied"), "--vary boundary=glied: "),
        (("--meshes", "example:none"), "no example 'none'"),
        (("--meshes", "none.obj"), "does not exist"),
    ],
)
def test_what_is_wrong_is_said_before_anything_begins(
    run: Run, options: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run("parameter_study", *options, code=2)
    assert words in capsys.readouterr().err
