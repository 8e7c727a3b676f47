from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import torchfair
from torchfair import MeshError
from torchfair.cli import command, main
from torchfair.cli.errors import CommandError

ROOT = Path(__file__).resolve().parents[2]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def triangle_file(tmp_path: Path) -> str:
    path = tmp_path / "triangle.obj"
    path.write_text(TRIANGLE)
    return str(path)


def one_line(text: str) -> str:
    assert text.endswith("\n")
    assert text.count("\n") == 1
    return text.rstrip("\n")


@pytest.mark.parametrize(
    ("arguments", "start", "named"),
    [
        ([], "torchfair: error: ", "command is needed"),
        (["sing"], "torchfair: error: ", "sing"),
        (["--loud"], "torchfair: error: ", "--loud"),
        (["measure"], "torchfair measure: error: ", "INPUT"),
        (["measure", "x.obj", "--loud"], "torchfair measure: error: ", "--loud"),
        (["measure", "x.obj", "--wor", "3"], "torchfair measure: error: ", "--wor"),
        (["measure", "x.obj", "--worst", "many"], "torchfair measure: error: ", "'many'"),
        (["measure", "x.obj", "--worst", "-1"], "torchfair measure: error: ", "'-1'"),
        (["measure", "missing.obj"], "torchfair measure: error: ", "missing.obj"),
        (["measure", "x.obj", "--worts=3"], "torchfair measure: error: ", "--worts=3, did you mean --worst? ("),
        (["--verson"], "torchfair: error: ", "did you mean --version?"),
        (["measure", "x.obj", "--steps", "3"], "torchfair measure: error: ", "--steps 3 (torchfair measure --help"),
        (["measure", "."], "torchfair measure: error: ", ".: is a folder: name the mesh files in it"),
        (["measure", "x\ny.obj"], "torchfair measure: error: ", "x y.obj"),
    ],
)
def test_wrong_usage_and_input_is_one_line_and_exit_code_2(
    arguments: list[str], start: str, named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    line = one_line(captured.err)
    assert line.startswith(start)
    assert named in line


def test_broken_file_names_the_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "broken.obj"
    path.write_text("v 0 0 0\nv 1 zero 0\nf 1 2 3\n")
    assert main(["measure", str(path)]) == 2
    line = one_line(capsys.readouterr().err)
    assert str(path) in line
    assert "line 2" in line


def test_version_and_help_go_to_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"torchfair {torchfair.__version__}\n"
    for arguments in (["--help"], ["measure", "--help"]):
        assert main(arguments) == 0
        captured = capsys.readouterr()
        assert captured.out.startswith("usage: torchfair")
        assert captured.err == ""


@pytest.mark.parametrize("number", ["-1", "-0.5", "-.5", "-5.", "-1e-3", "-2.5E+07"])
def test_negative_numbers_are_values_however_they_are_written(number: str) -> None:
    parser = command.CommandParser()
    parser.add_argument("--place", nargs=2)
    assert parser.parse_args(["--place", number, "0"]).place == [number, "0"]
    with pytest.raises(CommandError, match="--place"):
        parser.parse_args(["--place", "-x", "0"])


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (MeshError("bad\nmesh"), 2, "torchfair measure: error: bad mesh\n"),
        (CommandError("no handle 7"), 2, "torchfair measure: error: no handle 7\n"),
        (PermissionError(13, "Permission denied", "x.obj"), 2, "torchfair measure: error: x.obj: Permission denied\n"),
        (OSError("disk on fire"), 2, "torchfair measure: error: disk on fire\n"),
        (KeyboardInterrupt(), 130, "torchfair measure: interrupted\n"),
        (BrokenPipeError(), 141, ""),
    ],
)
def test_errors_while_running(
    error: BaseException,
    code: int,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(arguments: object) -> int:
        raise error

    monkeypatch.setattr(command.measure, "run", fail)
    assert main(["measure", "x.obj"]) == code
    assert capsys.readouterr().err == message


def c_module_interrupted() -> ImportError:
    """As modules written in C say that Ctrl-C came while they were loaded."""
    error = ImportError("initialization failed")
    error.__cause__ = KeyboardInterrupt()
    return error


def test_ctrl_c_while_a_module_written_in_c_is_loaded_on_the_way(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(arguments: object) -> int:
        try:
            raise c_module_interrupted()
        except ImportError as error:
            raise ImportError("numpy could not be loaded") from error

    monkeypatch.setattr(command.measure, "run", fail)
    assert main(["measure", "x.obj"]) == 130
    assert capsys.readouterr().err == "torchfair measure: interrupted\n"


def test_modules_that_cannot_be_loaded_are_not_taken_for_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(arguments: object) -> int:
        raise ImportError("no such library") from OSError("not found")

    monkeypatch.setattr(command.measure, "run", fail)
    with pytest.raises(ImportError, match="no such library"):
        main(["measure", "x.obj"])


def test_programming_errors_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(arguments: object) -> int:
        raise KeyError("bug")

    monkeypatch.setattr(command.measure, "run", fail)
    with pytest.raises(KeyError, match="bug"):
        main(["measure", "x.obj"])


@pytest.mark.skipif(os.name == "nt", reason="pipes end differently on Windows")
def test_fresh_process_parses_without_libraries_and_forgives_a_reader_that_goes_away(triangle_file: str) -> None:
    """One process for both, since starting one takes seconds."""
    script = f"""
import sys
from torchfair.cli import main
from torchfair.cli.command import build_parser
build_parser().parse_args(["measure", "x.obj"])
heavy = {{"trimesh", "kornia", "matplotlib", "rich", "scipy", "torchfair.projection"}} & set(sys.modules)
sys.exit(f"parsing imported {{heavy}}" if heavy else main(["measure", {triangle_file!r}]))
"""
    read, write = os.pipe()
    os.close(read)  # the reader is gone before anything is written
    try:
        done = subprocess.run([sys.executable, "-c", script], stdout=write, stderr=subprocess.PIPE, text=True)
    finally:
        os.close(write)
    assert done.stderr == ""
    assert done.returncode == 141


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX systems")
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
@pytest.mark.parametrize("library", ["torch", "numpy"])
def test_a_signal_while_libraries_are_loaded_leaves_no_traceback(
    library: str, name: str, code: int, triangle_file: str, tmp_path: Path
) -> None:
    """A library that presses Ctrl-C itself stands in front of the true one."""
    (tmp_path / f"{library}.py").write_text(f"import os, signal\nos.kill(os.getpid(), signal.{name})\n")
    done = subprocess.run(
        [sys.executable, "-m", "torchfair", "measure", triangle_file],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
    )
    assert done.stderr == "torchfair measure: interrupted\n"
    assert (done.returncode, done.stdout) == (code, "")


@pytest.mark.parametrize("words", ["KeyboardInterrupt", 'ImportError("failed") from KeyboardInterrupt()'])
def test_ctrl_c_while_the_command_line_itself_is_loaded(words: str, tmp_path: Path) -> None:
    (tmp_path / "argparse.py").write_text(f"raise {words}\n")
    done = subprocess.run(
        [sys.executable, "-m", "torchfair", "--help"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
