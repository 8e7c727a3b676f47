"""What all jobs have in common on the command line: exit codes, reports that reproduce, a new job in a few lines."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest
from helpers import report_in, wavy_grid

from torchfair.cli import main
from torchfair.cli.inputs import read_input
from torchfair.cli.job_command import JobCommand
from torchfair.cli.parser import CommandParser
from torchfair.cli.request import Request
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.io import load_mesh, save_mesh


@pytest.fixture
def roof(tmp_path: Path) -> Path:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    save_mesh(tmp_path / "roof.obj", vertices, topology)
    return tmp_path / "roof.obj"


def test_what_was_not_reached_is_the_last_line_and_exit_code_1(
    roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two vertices are pulled to one place, which faces between them forbid."""
    output, place = tmp_path / "pulled" / "roof.obj", ["2.9", "1.8", "-0.2"]
    words = ["--handle", "20", *place, "--handle", "21", *place, "--iterations", "3", "--no-pictures"]
    assert main(["fair", str(roof), "-o", str(output), *words]) == 1
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert lines[-2] == f"wrote {output.parent / 'roof.report.json'}"
    assert lines[-1].startswith("distance of a handle from its target")
    assert "NOT REACHED; faces would become too small" in lines[-1]
    assert out.count("NOT REACHED") == 1  # not once more among the notes
    assert load_mesh(output).topology.num_faces == load_mesh(roof).topology.num_faces
    report = report_in(output.parent)
    assert report["holds"] is False
    missed = [promise for promise in report["promises"] if not promise["holds"]]
    assert [promise["name"] for promise in missed] == ["distance of a handle from its target"]
    assert missed[0]["reached"] > missed[0]["asked"] > 0
    kept = [promise for promise in report["promises"] if promise["holds"]]
    assert out.count("kept: ") == len(kept)
    assert f"kept: {kept[0]['name']}" in out


def test_refinements_that_were_not_reached_give_exit_code_1(
    roof: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("torchfair.progress.ProgressDisplay.__call__", lambda display, record: True)  # stop at once
    words = ["--levels", "2", "--no-pictures"]
    assert main(["form", str(roof), "-o", str(roof.parent / "x.obj"), *words]) == 1
    assert "0 of 2 refinements: NOT REACHED; stopped by the callback" in capsys.readouterr().out.splitlines()[-1]


def test_a_report_given_back_as_settings_finds_the_same_mesh_to_the_last_bit(roof: Path, tmp_path: Path) -> None:
    options = ["--fairness", "0.7", "--smallest-angle", "12.3", "--distance", "none", "--iterations", "5"]
    first, second, third = (tmp_path / name / "out.obj" for name in ("first", "second", "third"))
    assert main(["fair", str(roof), "-o", str(first), *options, "--no-pictures"]) == 0
    given = ["--settings", str(first.parent / "out.report.json"), "--no-pictures"]
    assert main(["fair", str(roof), "-o", str(second), *given]) == 0
    assert second.read_bytes() == first.read_bytes()
    reports = [report_in(path.parent) for path in (first, second)]
    assert reports[0]["settings"] == reports[1]["settings"]
    assert reports[0]["energies"] == reports[1]["energies"]
    assert main(["fair", str(roof), "-o", str(third), *given, "--fairness", "0.1"]) == 0
    assert third.read_bytes() != first.read_bytes()
    assert report_in(third.parent)["settings"]["fairness_weight"] == 0.1


def test_reports_of_another_job_and_bad_settings_files_are_refused_before_any_work(
    roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = tmp_path / "mine.json", tmp_path / "new" / "out.obj"
    for values, words in (
        ({"job": "form", "settings": {}}, "the report of the job 'form', not of 'fair'"),
        ({"smoothnes": 1}, "unknown field 'smoothnes', did you mean smoothing?"),
        ({"smoothing": "x"}, "smoothing: expected a number, got 'x'"),
    ):
        path.write_text(json.dumps(values))
        assert main(["fair", str(roof), "-o", str(output), "--settings", str(path)]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith(f"torchfair fair: error: {path}: ")
        assert err.count("\n") == 1
        assert words in err
    assert main(["fair", str(roof), "-o", str(output), "--settings", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert not output.parent.exists()


def test_help_of_every_job_says_the_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    for job in ("fair", "form", "symmetric"):
        assert main([job, "--help"]) == 0
        text = " ".join(capsys.readouterr().out.split())
        assert "exit codes: 0 done, and all that was promised holds; 1 something" in text
        assert "130 interrupted" in text


class Toy(JobCommand):
    """All that a new job needs."""

    job = "toy"
    purpose = "show how short a command is"
    description = "Does what fair does."
    pictures: ClassVar = {"picture.txt": lambda path, request, result, overwrite: path.write_text(str(result.steps))}

    def settings(self) -> type[Any]:
        return FairSettings

    def function(self) -> Callable[..., Any]:
        return minimise_normal_variation

    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument("input")

    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        return Request(read_input(arguments.input), {}, notes=["read"], report={"own": 1})


def test_a_new_job_is_settings_inputs_a_function_and_pictures(
    roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parser = CommandParser(prog="torchfair")
    Toy().add_parser(parser.add_subparsers())
    output = tmp_path / "new" / "out.off"
    arguments = parser.parse_args(["toy", str(roof), "-o", str(output), "--iterations", "2", "--boundary", "fixed"])
    assert arguments.run(arguments) == 0
    out = capsys.readouterr().out
    assert "note: read" in out
    report = report_in(output.parent)
    assert (report["job"], report["own"]) == ("toy", 1)
    assert report["request"]["input"] == str(roof)
    assert report["settings"]["boundary"] == "fixed"
    assert (output.parent / "out.picture.txt").read_text() == str(report["steps"])
    written = [line.removeprefix("wrote ") for line in out.splitlines() if line.startswith("wrote ")]
    assert [Path(line).name for line in written] == ["out.off", "out.report.json", "out.picture.txt"]


def test_the_mesh_is_there_when_what_follows_fails(roof: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object) -> None:
        raise OSError(28, "No space left on device", "picture.txt")

    monkeypatch.setattr(Toy, "pictures", {"picture.txt": fail})
    monkeypatch.setattr("torchfair.cli.command._COMMANDS", (Toy(),))
    output = tmp_path / "new" / "out.obj"
    assert main(["toy", str(roof), "-o", str(output), "--iterations", "1"]) == 2
    assert {path.name for path in output.parent.iterdir()} == {"out.obj", "out.report.json"}
