"""Several inputs of one command."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from helpers import wavy_grid

from torchfair.cli import main
from torchfair.cli.command import build_parser
from torchfair.io import load_mesh, save_mesh

FEW = ["--iterations", "1", "--no-pictures"]


@pytest.fixture
def meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two meshes, and between them a file that is none."""
    monkeypatch.chdir(tmp_path)
    for number in (3, 4):
        save_mesh(f"m{number}.obj", *wavy_grid(number + 2, 5, triangles=True))
    Path("m3b.obj").write_text("v 0 0 0\n")
    return ["m3.obj", "m3b.obj", "m4.obj"]


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


def test_inputs_may_stand_on_both_sides_of_options(meshes: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", meshes[0], meshes[2], "--json"]) == 0
    expected = capsys.readouterr().out
    assert main(["measure", meshes[0], "--json", meshes[2]]) == 0
    assert capsys.readouterr().out == expected
    assert main(["measure", meshes[0], "--json", meshes[2], "--unknown"]) == 2
    assert "--unknown" in one_line(capsys)


def test_measures_of_several_meshes_are_rows_columns_or_objects(
    meshes: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """All three say what each mesh says alone; what cannot be read is listed at the end."""
    alone = {}
    for name in (meshes[0], meshes[2]):
        assert main(["measure", name, "--json"]) == 0
        alone[name] = json.loads(capsys.readouterr().out)
    assert main(["measure", *meshes, "--json"]) == 1
    said = capsys.readouterr()
    assert [json.loads(line) for line in said.out.splitlines()] == list(alone.values())
    assert said.err == "torchfair measure: 2 of 3 done\n  m3b.obj: the mesh has no faces\n"
    assert main(["measure", *meshes, "--csv"]) == 1
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [row["file"] for row in rows] == list(alone)
    for row in rows:
        numbers = {key: value for key, value in alone[row["file"]].items() if key in row and value is not None}
        assert len(numbers) > 25
        assert {key: value if key == "file" else float(row[key]) for key, value in numbers.items()} == numbers
    assert main(["measure", *meshes]) == 1
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["vertices", "faces", "E"]
    for line, (name, found) in zip(lines, alone.items(), strict=True):
        words = line.split()
        assert words[:3] == [name, str(found["vertices"]), str(found["faces"])]
        assert float(words[3]) == pytest.approx(found["normal_variation"], rel=1e-4)
    assert main(["measure", meshes[0], "--csv"]) == 0
    assert capsys.readouterr().out.count("\n") == 2


def test_what_is_to_be_known_of_a_mesh_is_said_beside_the_table(
    meshes: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("seam.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 .2\nv 0 0 0\nv 1 1 .2\nv 0 1 0\nf 1 2 3\nf 4 5 6\n")
    assert main(["measure", meshes[0], "seam.obj"]) == 0
    said = capsys.readouterr()
    assert said.out.count("\n") == 3
    assert said.err.startswith("seam.obj: ")
    assert "--weld" in said.err


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_jobs_do_all_that_can_be_done_and_list_the_rest(
    meshes: list[str], jobs: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("pickle.py").write_text("raise AssertionError('not for us')")  # a file of the working folder is no module
    assert main(["denoise", *meshes, "-o", "out", "--jobs", jobs, *FEW]) == 1
    said = capsys.readouterr()
    names = {path.name for path in Path("out").iterdir()}
    assert names == {"m3.obj", "m3.report.json", "m4.obj", "m4.report.json"}
    assert said.err.endswith("torchfair denoise: 2 of 3 done\n  m3b.obj: the mesh has no faces\n")
    heads = [line for line in said.out.splitlines() if line.startswith("== ")]
    assert [head for head in heads if "m3b" not in head] == ["== m3.obj", "== m4.obj"]
    assert said.out.count("wrote out/m4.obj") == 1
    assert ("iteration 1/1" in said.err) == (jobs == "1")  # no mixture of several
    assert json.loads(Path("out/m4.report.json").read_text())["request"]["output"] == "out/m4.obj"
    assert main(["denoise", "m3.obj", "-o", "alone.obj", *FEW]) == 0
    assert Path("alone.obj").read_bytes() == Path("out/m3.obj").read_bytes()


COLLISIONS = {
    "same name": (["a/m.obj", "b/m.obj", "-o", "out"], "a/m.obj, b/m.obj"),
    "but for case": (["a/m.obj", "b/M.obj", "-o", "out"], "a/m.obj, b/M.obj"),
    "same report": (["a/m.obj", "a/m.ply", "-o", "out"], "a/m.obj, a/m.ply"),
    "an input": (["a/m.obj", "b/n.obj", "-o", "b", "--force"], "b/n.obj is an input"),
    "no folder": (["a/m.obj", "b/n.obj", "-o", "out.obj"], "--output out.obj: several inputs need a folder"),
}


@pytest.mark.parametrize("command", ["fair", "denoise", "mesh", "subdivide", "symmetric", "form"])
@pytest.mark.parametrize("case", COLLISIONS)
def test_names_that_collide_are_refused_before_anything_is_read(
    command: str, case: str, meshes: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    words, said = COLLISIONS[case]  # none of these files exists
    assert main([command, *words]) == 2
    assert said in one_line(capsys)
    assert not Path("out").exists()


def test_reports_on_several_meshes_share_a_folder(meshes: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    names = [meshes[0], meshes[2]]
    assert main(["diagnose", *names, "-o", "out", "--no-pictures", "--json"]) == 0
    assert [json.loads(line)["file"] for line in capsys.readouterr().out.splitlines()] == names
    assert {path.name for path in Path("out").iterdir()} == {"m3.diagnosis.json", "m4.diagnosis.json"}
    assert main(["diagnose", "x/m3.obj", "m3.obj", "-o", "out"]) == 2
    assert "x/m3.obj, m3.obj" in one_line(capsys)


@pytest.mark.parametrize("output", ["out", "out/", "out/x.off"])
def test_an_output_without_extension_is_a_folder_for_one_input_too(meshes: list[str], output: str) -> None:
    """So that ``*.obj`` may be one file."""
    assert main(["subdivide", meshes[0], "-o", output]) == 0
    assert {path.name for path in Path("out").iterdir()} == {"x.off" if output.endswith("off") else "m3.obj"}
    assert main(["subdivide", "example:roof", "-o", "out"]) == 0
    assert load_mesh("out/roof.obj").topology.num_faces > 0


def test_patterns_that_the_shell_leaves_are_files(meshes: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path("m[34].obj").write_text(Path("m3.obj").read_text())  # a name, not a pattern
    assert main(["measure", "m[34].obj", "m?.obj", "--csv"]) == 0
    assert [line.split(",")[0] for line in capsys.readouterr().out.splitlines()] == [
        "file",
        "m[34].obj",
        "m3.obj",
        "m4.obj",
    ]
    assert main(["measure", "n*.obj"]) == 2
    assert "n*.obj" in one_line(capsys)


def test_ctrl_c_ends_the_whole(
    meshes: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*words: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("torchfair.progress.ProgressDisplay.__call__", stop)
    assert main(["denoise", *meshes, "-o", "out", *FEW]) == 130
    assert {path.name for path in Path("out").iterdir()} == {"m3.obj", "m3.report.json"}
    assert capsys.readouterr().err.endswith(
        "0 of 3 done\n  m3.obj: interrupted\n  m3b.obj: not begun\n  m4.obj: not begun\n"
    )


OUT_OF_RANGE = [
    *(("fair", option) for option in ("smallest-angle", "corner-angle", "crease-angle")),
    *(("form", option) for option in ("corner-angle", "least-angle")),
    *(("mesh", option) for option in ("corner-angle", "crease-angle", "boundary-angle")),
    *(("symmetric", "smallest-angle"), ("subdivide", "corner-angle"), ("fair", "smallest-area"), ("form", "through")),
    *(("fair", "planar-reach"), ("symmetric", "saddle-margin"), ("form", "smoothing")),
]


@pytest.mark.parametrize(("command", "option"), OUT_OF_RANGE)
@pytest.mark.parametrize("number", ["200", "-1", "nan"])
def test_what_is_out_of_range_is_refused_by_name_once_and_before_anything_is_read(
    command: str, option: str, number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if option in ("through", "planar-reach", "saddle-margin") and number != "nan":
        number = "inf" if option != "planar-reach" else "-2"
    count = ["--quads", "9"] if command == "mesh" else []
    words = [f"--{option}={number}"] if option != "through" else ["--through", "0", number, "0"]
    for inputs in (["missing.obj"], ["missing.obj", "another.obj"]):
        assert main([command, *inputs, "-o", str(tmp_path / "out"), *count, *words]) == 2
        line = one_line(capsys)
        assert f"--{option}" in line
        assert "missing" not in line
    assert list(tmp_path.iterdir()) == []


def test_every_command_takes_several_inputs() -> None:
    for command in ("measure", "diagnose", "reflect", "fair", "form", "symmetric", "denoise", "mesh", "subdivide"):
        output = [] if command in ("measure", "diagnose", "reflect") else ["-o", "out"]
        arguments = build_parser().parse_args([command, "a.obj", "b.obj", "--jobs", "3", *output])
        assert (arguments.input, arguments.jobs) == (["a.obj", "b.obj"], 3)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX systems")
def test_ctrl_c_reaches_processes_which_keep_their_best(tmp_path: Path) -> None:
    for number in range(3):
        save_mesh(tmp_path / f"m{number}.obj", *wavy_grid(30 + number, 30, triangles=True))
    words = ["fair", *(f"m{number}.obj" for number in range(3)), "-o", "out", "--jobs", "2", "--no-pictures"]
    words += ["--iterations", "10000", "--merit-tolerance", "0"]
    process = subprocess.Popen(
        [sys.executable, "-m", "torchfair", *words], cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE
    )
    time.sleep(15)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert b"Traceback" not in err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("m0.obj", "m0.report.json", "m1.obj", "m1.report.json")
    }
    assert err.decode().endswith("0 of 3 done\n  m0.obj: interrupted\n  m1.obj: interrupted\n  m2.obj: not begun\n")
