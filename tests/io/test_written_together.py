"""Files that belong together take their names together."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from torchfair import MeshFileError
from torchfair.io import atomic_write_text, written_together

NAMES = ("mesh", "report", "labels")


def write_all(folder: Path, text: str, *, overwrite: bool = True) -> None:
    with written_together():
        for name in NAMES:
            atomic_write_text(folder / name, text, overwrite=overwrite)


def content(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_nothing_is_there_before_all_is(tmp_path: Path) -> None:
    with written_together():
        atomic_write_text(tmp_path / "mesh", "new")
        assert not (tmp_path / "mesh").exists()
        with written_together():  # the same as the outer one
            atomic_write_text(tmp_path / "report", "new")
        assert not (tmp_path / "report").exists()
    assert content(tmp_path) == {"mesh": "new", "report": "new"}
    atomic_write_text(tmp_path / "alone", "new")
    assert (tmp_path / "alone").exists()


@pytest.mark.parametrize("fails_at", [1, 2, 3])
@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("has_links", [True, False])
def test_one_that_cannot_be_written_leaves_all_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails_at: int, call: str, has_links: bool
) -> None:
    """The disk is full, or another process holds a file open (Windows)."""
    write_all(tmp_path, "old")
    (tmp_path / NAMES[0]).unlink()  # and one that was not there
    before, real, calls = content(tmp_path), getattr(os, call), []

    def fail(*words: object) -> object:
        calls.append(words)
        if len(calls) == fails_at:
            raise OSError(28, "No space left on device")
        return real(*words)

    def refuse(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(os, call, fail)
    if not has_links:
        monkeypatch.setattr(os, "link", refuse)
    with pytest.raises(MeshFileError, match=rf"{NAMES[fails_at - 1]}: cannot be written \(No space left on device"):
        write_all(tmp_path, "new")
    assert content(tmp_path) == before
    monkeypatch.undo()
    write_all(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "new")


def test_a_name_that_is_taken_meanwhile_leaves_the_others_free(tmp_path: Path) -> None:
    def write() -> None:
        with written_together():
            for name in NAMES:
                atomic_write_text(tmp_path / name, "mine")
            (tmp_path / "report").write_text("other's")

    with pytest.raises(MeshFileError, match="report: exists already"):
        write()
    assert content(tmp_path) == {"report": "other's"}


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_what_ends_the_body_writes_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    def body() -> None:
        with written_together():
            atomic_write_text(tmp_path / "mesh", "new")
            raise error

    with pytest.raises(error):
        body()
    assert content(tmp_path) == {}
    atomic_write_text(tmp_path / "mesh", "later")  # on its own again
    assert content(tmp_path) == {"mesh": "later"}


@pytest.mark.parametrize("after", [False, True])
def test_an_interrupt_between_two_names_puts_all_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: bool
) -> None:
    """Whether the second file has its name when the interrupt comes, or not yet."""
    write_all(tmp_path, "old")
    real: Callable[[Path, Path], None] = os.replace
    calls = []

    def interrupted(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) != 2 or after:
            real(source, target)
        if len(calls) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_all(tmp_path, "new")
    assert content(tmp_path) == dict.fromkeys(NAMES, "old")
    assert os.stat(tmp_path / "mesh").st_nlink == 1
