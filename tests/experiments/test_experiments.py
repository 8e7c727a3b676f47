"""Experiments behave as programs should, and the README tells of each; what they claim is tested beside this file."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

FOLDER = Path(__file__).parents[2] / "experiments"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("[!_]*.py"))

Run = Callable[..., dict[str, Any]]


def test_results_are_not_replaced_without_force(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--steps", "4", "--cells", "2")
    run("fig11_energy_per_area", *options)
    chart = tmp_path / "out" / "energy_per_area.png"
    (tmp_path / "out" / "result.json").unlink()
    written = chart.stat().st_mtime_ns
    run("fig11_energy_per_area", *options, code=2)
    captured = capsys.readouterr()
    assert "--force" in captured.err
    assert captured.err.count("\n") == 1
    assert chart.stat().st_mtime_ns == written
    assert run("fig11_energy_per_area", *options, "--force")["experiment"] == "fig11_energy_per_area"
    assert chart.stat().st_mtime_ns != written


@pytest.mark.parametrize("options", [("--rows", "7", "9"), ("--rows", "8"), ("--surfaces", "cube"), ("--seed", "-1")])
def test_settings_out_of_bounds_are_refused(
    script: Callable[[str], ModuleType], capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    with pytest.raises(SystemExit) as stop:
        script("fig07_principal_meshes").main(list(options))
    assert stop.value.code == 2
    assert options[0].removeprefix("--") in capsys.readouterr().err


def test_scripts_run_from_the_command_line() -> None:
    command = [sys.executable, str(FOLDER / "fig18_hybrid_roof.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "--strips" in done.stdout
    assert "[13]" in done.stdout  # the default


@pytest.mark.parametrize("name", SCRIPTS)
def test_readme_has_a_row_for_every_script(name: str) -> None:
    assert f"`python experiments/{name}.py`" in (FOLDER / "README.md").read_text()
