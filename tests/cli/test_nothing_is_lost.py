"""Results are written where they were to go, or somewhere else, and mesh and report never part."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest
from helpers import wavy_grid

from torchfair import MeshFileError
from torchfair.cli import main
from torchfair.cli.inputs import read_input
from torchfair.cli.job_command import JobCommand
from torchfair.cli.request import Request
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.io import load_mesh, save_mesh


def draw(path: Path, request: Request, result: Any, overwrite: bool) -> None:
    from torchfair.io import atomic_write_text

    atomic_write_text(path, str(result.steps), overwrite=overwrite)


class Toy(JobCommand):
    """A job during which something happens."""

    job = "toy"
    purpose = "lose nothing"
    description = "Does what fair does."
    pictures: ClassVar = {"one.png": draw, "two.png": draw}
    meanwhile: ClassVar[Callable[[], object]] = staticmethod(lambda: None)

    def settings(self) -> type[Any]:
        return FairSettings

    def function(self) -> Callable[..., Any]:
        def job(*start: Any, **options: Any) -> Any:
            result = minimise_normal_variation(*start, **options)
            type(self).meanwhile()
            return result

        return job

    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument("input")

    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        return Request(read_input(arguments.input), {})


class Folder:
    """A folder with ``roof.obj``, and ``toy`` among the commands; everything else is in other folders."""

    def __init__(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.path, self.monkeypatch, self.out = path, monkeypatch, path / "out"
        save_mesh(path / "roof.obj", *wavy_grid(3, 3, triangles=True))
        for name in ("home", "working", "temporary"):
            (path / name).mkdir()
        monkeypatch.setattr("torchfair.cli.command._COMMANDS", (Toy(),))
        monkeypatch.setattr(Path, "home", lambda: path / "home")
        monkeypatch.setattr("tempfile.tempdir", str(path / "temporary"))
        monkeypatch.chdir(path / "working")

    def run(self, *words: str, output: str = "roof.obj", meanwhile: Callable[[], object] = lambda: None) -> int:
        self.monkeypatch.setattr(Toy, "meanwhile", staticmethod(meanwhile))
        return main(["toy", str(self.path / "roof.obj"), "-o", str(self.out / output), "--iterations", "1", *words])

    def names(self) -> set[str]:
        return {path.name for path in self.out.iterdir()}

    def content(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in self.out.iterdir()}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folder:
    return Folder(tmp_path, monkeypatch)


ALL = {"roof.obj", "roof.report.json", "roof.one.png", "roof.two.png"}


def test_outputs_share_a_folder_and_pictures_of_an_earlier_run_go_with_its_report(folder: Folder) -> None:
    assert folder.run() == 0
    assert folder.names() == ALL
    (folder.out / "roof.three.png").write_text("my own")
    assert folder.run(output="other.off") == 0
    before = {name: data for name, data in folder.content().items() if name.startswith("other")}
    assert folder.run("--force", "--no-pictures") == 0
    assert folder.names() == {"roof.obj", "roof.report.json", "roof.three.png", *before}
    assert {name: folder.content()[name] for name in before} == before
    assert json.loads((folder.out / "roof.report.json").read_text())["files"] == ["roof.obj", "roof.report.json"]
    assert json.loads(before["other.report.json"])["files"][0] == "other.off"


def test_the_report_of_another_mesh_is_not_replaced(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    assert folder.run() == 0
    before = folder.content()
    assert folder.run("--force", output="roof.ply") == 2
    assert "roof.report.json is the report of" in capsys.readouterr().err
    assert folder.content() == before
    assert folder.run("--force", "--results", str(folder.out / "of_ply"), output="roof.ply") == 0
    assert {path.name for path in (folder.out / "of_ply").iterdir()} == ALL - {"roof.obj"}
    (folder.out / "roof.obj").unlink()
    assert folder.run("--force", "--results", str(folder.out), output="roof.ply") == 0  # there is no other any more


def test_copies_of_a_folder_are_outputs_of_their_own(folder: Folder) -> None:
    assert folder.run() == 0
    shutil.copytree(folder.out, folder.path / "copy")
    assert folder.run("--force", output="../copy/roof.obj") == 0


def test_reports_on_meshes_of_one_name_do_not_replace_each_other(
    folder: Folder, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of outputs that share ``--results``."""
    shared = ["--results", str(folder.path / "shared")]
    assert folder.run(*shared) == 0
    assert folder.run(*shared, "--force", output="more/roof.obj") == 2
    assert f"is the report of {folder.out / 'roof.obj'}" in capsys.readouterr().err


@pytest.mark.parametrize("taken", sorted(ALL - {"roof.one.png", "roof.two.png"}))
def test_a_name_that_is_taken_meanwhile_is_left_alone(
    folder: Folder, taken: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder.path / "out").mkdir()
    (folder.out / "roof-2.one.png").write_text("taken, too")
    assert folder.run(meanwhile=lambda: (folder.out / taken).write_text("other's")) == 2
    assert (folder.out / taken).read_text() == "other's"
    assert folder.names() == {taken, "roof-2.one.png", *(name.replace("roof", "roof-3") for name in ALL)}
    last = capsys.readouterr().err.splitlines()[-1]
    assert f"{taken}: exists already" in last
    assert f"the mesh is {folder.out / 'roof-3.obj'} instead, its report {folder.out / 'roof-3.report.json'}" in last
    assert load_mesh(folder.out / "roof-3.obj").topology.num_faces == 8


def test_a_file_that_another_process_holds_open_stays_and_the_result_is_beside(
    folder: Folder, capsys: pytest.CaptureFixture[str]
) -> None:
    """On Windows no file takes the name of one that is open."""
    assert folder.run() == 0
    before, real = folder.content(), os.replace

    def refuse(source: Path, target: Path) -> None:
        if target.name == "roof.report.json" and source.suffix == ".tmp" and not held:
            held.append(source)
            raise PermissionError(13, "The process cannot access the file")
        real(source, target)

    held: list[Path] = []
    assert folder.run("--force", meanwhile=lambda: folder.monkeypatch.setattr(os, "replace", refuse)) == 2
    after = folder.content()
    assert {name: after[name] for name in before} == before
    assert set(after) == ALL | {name.replace("roof", "roof-2") for name in ALL}
    assert "roof.report.json: cannot be written (The process cannot access the file)" in capsys.readouterr().err


@pytest.mark.parametrize("full", [("out",), ("out", "working"), ("out", "working", "home")])
@pytest.mark.parametrize("fails_at", [1, 2])
def test_on_a_full_disk_the_old_files_stay_and_the_new_ones_are_elsewhere(
    folder: Folder, full: tuple[str, ...], fails_at: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """The disk becomes full with the mesh or with its report."""
    assert folder.run() == 0
    before, real, calls = folder.content(), os.open, []

    def refuse(path: Any, *words: Any) -> int:
        if Path(path).suffix == ".tmp" and any(part in full for part in Path(path).parts):
            calls.append(path)
            if len(calls) % 2 == fails_at % 2 or fails_at == 1:
                raise OSError(28, "No space left on device")
        return real(path, *words)

    def fill() -> None:
        folder.monkeypatch.setattr(os, "open", refuse)

    assert folder.run("--force", "--no-pictures", meanwhile=fill) == 2
    folder.monkeypatch.setattr(os, "open", real)
    assert folder.content() == before
    place = ("working", "home", "temporary")[len(full) - 1]
    assert [p.parent.parent.name for p in folder.path.glob("*/torchfair-*/roof.obj")] == [place]
    assert not [p for p in folder.path.glob("*/torchfair-*") if p.parent.name != place]  # no empty folders
    (kept,) = folder.path.glob("*/torchfair-*")
    assert {path.name for path in kept.iterdir()} == {"roof.obj", "roof.report.json"}
    assert f"(No space left on device); the mesh is {kept / 'roof.obj'} instead" in capsys.readouterr().err


def test_a_result_that_fits_nowhere_is_an_error(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    def refuse(*words: Any, **options: Any) -> None:
        raise MeshFileError("roof.obj", "cannot be written (no)")

    assert folder.run(meanwhile=lambda: folder.monkeypatch.setattr("torchfair.cli.outputs.save_result", refuse)) == 2
    assert "roof.obj: cannot be written (no)" in capsys.readouterr().err
    assert not list(folder.path.glob("*/torchfair-*"))


def test_a_picture_that_cannot_be_written_costs_no_other(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    assert folder.run(meanwhile=lambda: (folder.out / "roof.one.png").write_text("taken")) == 2
    said = capsys.readouterr()
    assert [line.rpartition("/")[2] for line in said.out.splitlines() if line.startswith("wrote ")] == [
        "roof.obj",
        "roof.report.json",
        "roof.two.png",
    ]
    assert "roof.one.png: exists already" in said.err


def test_ctrl_c_while_pictures_are_drawn_says_which_are_missing(
    folder: Folder, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*words: Any) -> None:
        raise KeyboardInterrupt

    folder.monkeypatch.setattr(Toy, "pictures", {"one.png": draw, "two.png": stop, "three.png": draw})
    assert folder.run() == 130
    assert folder.names() == ALL - {"roof.two.png"}
    out = capsys.readouterr().out
    assert f"not written: {folder.out / 'roof.two.png'}\nnot written: {folder.out / 'roof.three.png'}" in out


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX systems")
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_between_the_job_and_its_files_costs_pictures_only(
    folder: Folder, name: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """The best mesh is known and not yet written: no moment loses it."""
    number = getattr(signal, name)
    handler = signal.getsignal(number)
    assert folder.run(meanwhile=lambda: signal.raise_signal(number)) == code
    assert folder.names() == {"roof.obj", "roof.report.json"}
    assert f"not written: {folder.out / 'roof.one.png'}" in capsys.readouterr().out
    assert signal.getsignal(number) is handler
    assert folder.run("--force") == 0


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX systems")
def test_signals_that_are_ignored_stay_so(folder: Folder) -> None:
    """As with nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert folder.run(meanwhile=lambda: signal.raise_signal(signal.SIGHUP)) == 0
        assert folder.names() == ALL
    finally:
        signal.signal(signal.SIGHUP, before)


def links(out: Path) -> dict[str, Callable[[], object]]:
    """What is in the way, by what is said of it."""
    return {
        "is a folder": lambda: (out / "roof.obj").mkdir(),
        "is a link that leads nowhere": lambda: (out / "roof.obj").symlink_to("roof.obj"),
        "leads nowhere": lambda: (out / "roof.report.json").symlink_to(out / "no" / "such"),
        "is not a regular file": lambda: os.mkfifo(out / "roof.two.png"),
        "is no folder": lambda: (shutil.rmtree(out), out.write_text("")),
    }


@pytest.mark.skipif(os.name == "nt", reason="links and pipes of POSIX systems")
@pytest.mark.parametrize("words", sorted(links(Path())))
def test_what_cannot_be_written_is_refused_before_anything_is_read(
    folder: Folder, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder.out.mkdir()
    links(folder.out)[words]()
    (folder.path / "roof.obj").unlink()  # it would be missed
    assert folder.run("--force") == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    if words != "is no folder":
        assert folder.run() == 2
        assert "exists: choose another name or folder, or --force" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="links of POSIX systems")
def test_links_are_followed(folder: Folder) -> None:
    (folder.path / "far").mkdir()
    folder.out.mkdir()
    (folder.out / "roof.obj").symlink_to(folder.path / "far" / "mesh.obj")
    assert folder.run("--force") == 0
    assert (folder.out / "roof.obj").is_symlink()
    assert load_mesh(folder.path / "far" / "mesh.obj").topology.num_faces == 8


def test_folders_are_tried_and_measured_before_the_job(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    def never() -> None:
        raise AssertionError("it was solved")

    def full(path: object) -> Any:
        return shutil._ntuple_diskusage(10**9, 10**9, 1_500_000)

    folder.monkeypatch.setattr(shutil, "disk_usage", full)
    assert folder.run(meanwhile=never) == 2
    assert "1.5 MB are free on its disk, and about 4 MB needed" in capsys.readouterr().err
    assert folder.run("--results", str(folder.out), "--no-pictures", meanwhile=never) == 2
    folder.monkeypatch.undo()


def test_a_folder_where_nothing_can_be_written_is_refused(folder: Folder, capsys: pytest.CaptureFixture[str]) -> None:
    real = Path.write_bytes

    def refuse(path: Path, data: bytes) -> int:
        if path.suffix == ".tmp":
            raise OSError(30, "Read-only file system")
        return real(path, data)

    folder.monkeypatch.setattr(Path, "write_bytes", refuse)
    assert folder.run() == 2
    assert f"{folder.out}: cannot be written in (Read-only file system)" in capsys.readouterr().err
