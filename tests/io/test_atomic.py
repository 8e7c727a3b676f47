"""Files appear whole or not at all."""

from __future__ import annotations

import os
import stat
import threading
from pathlib import Path

import pytest

from torchfair import MeshFileError
from torchfair.io import atomic_write_bytes, atomic_write_text

posix = pytest.mark.skipif(os.name != "posix", reason="permissions and special files of POSIX systems")


def test_bytes_and_text(tmp_path: Path) -> None:
    atomic_write_bytes(tmp_path / "a", b"\0\r\n\xff")
    atomic_write_text(tmp_path / "b", "one\ntwo é\n")
    assert (tmp_path / "a").read_bytes() == b"\0\r\n\xff"
    assert (tmp_path / "b").read_bytes() == "one\ntwo é\n".encode()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]


def test_strings_and_relative_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    atomic_write_bytes("a", b"x")
    assert (tmp_path / "a").read_bytes() == b"x"


def test_no_silent_replacement(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with pytest.raises(MeshFileError, match="exists already"):
        atomic_write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    atomic_write_bytes(path, b"new", overwrite=True)
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("has_links", [True, False])
def test_a_file_that_appears_meanwhile_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_links: bool) -> None:
    """Between the first look and the last step another program creates the file."""
    path = tmp_path / "a"
    real_fsync, real_link = os.fsync, os.link

    def create_meanwhile(descriptor: int) -> None:
        real_fsync(descriptor)
        path.write_bytes(b"other")

    def link(source: Path, target: Path) -> None:
        if not has_links:
            raise OSError(95, "Operation not supported")
        real_link(source, target)

    monkeypatch.setattr(os, "fsync", create_meanwhile)
    monkeypatch.setattr(os, "link", link)
    with pytest.raises(MeshFileError, match="exists already"):
        atomic_write_bytes(path, b"mine")
    assert path.read_bytes() == b"other"
    assert list(tmp_path.iterdir()) == [path]


def test_file_systems_without_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(os, "link", refuse)
    atomic_write_bytes(tmp_path / "a", b"x")
    assert (tmp_path / "a").read_bytes() == b"x"
    assert len(list(tmp_path.iterdir())) == 1
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(MeshFileError, match="not supported"):
        atomic_write_bytes(tmp_path / "b", b"x")
    assert len(list(tmp_path.iterdir())) == 1


def test_one_of_many_writers_wins(tmp_path: Path) -> None:
    path = tmp_path / "a"
    outcomes: list[object] = []
    barrier = threading.Barrier(8)

    def write(number: int) -> None:
        barrier.wait()
        try:
            atomic_write_bytes(path, bytes([number]) * 1000)
            outcomes.append(number)
        except MeshFileError as error:
            outcomes.append(error)

    threads = [threading.Thread(target=write, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    winners = [outcome for outcome in outcomes if isinstance(outcome, int)]
    assert len(outcomes) == 8
    assert len(winners) == 1
    assert path.read_bytes() == bytes(winners) * 1000
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("step", "overwrite"), [("fsync", False), ("fsync", True), ("link", False), ("replace", True)])
def test_a_failure_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, overwrite: bool
) -> None:
    path = tmp_path / "a"
    if overwrite:
        path.write_bytes(b"old")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, step, interrupt)
    with pytest.raises(KeyboardInterrupt):
        atomic_write_bytes(path, b"new", overwrite=overwrite)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"old"] * overwrite


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MeshFileError, match=r"cannot be written \(No space left on device"):
        atomic_write_bytes(path, b"new", overwrite=True)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"old"]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match=r"the folder .*missing does not exist"):
        atomic_write_bytes(tmp_path / "missing" / "a", b"")
    with pytest.raises(MeshFileError, match="is a folder"):
        atomic_write_bytes(tmp_path, b"", overwrite=True)
    with pytest.raises(MeshFileError, match="no usable file name"):
        atomic_write_bytes(tmp_path / "a\0b", b"")
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(MeshFileError, match=r"the folder .*file does not exist"):
        atomic_write_bytes(tmp_path / "file" / "a", b"")
    with pytest.raises(MeshFileError, match="cannot be written"):
        atomic_write_bytes(tmp_path / ("a" * 300), b"")


@posix
def test_special_files_are_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for overwrite in (False, True):
        with pytest.raises(MeshFileError):
            atomic_write_bytes(pipe, b"x", overwrite=overwrite)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@posix
def test_links_are_followed_only_when_overwriting(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "link").symlink_to("real")
    (tmp_path / "dangling").symlink_to("nowhere")
    for name in ("link", "dangling"):
        with pytest.raises(MeshFileError, match="exists already"):
            atomic_write_bytes(tmp_path / name, b"new")
        atomic_write_bytes(tmp_path / name, b"new", overwrite=True)
        assert (tmp_path / name).is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"
    assert (tmp_path / "nowhere").read_bytes() == b"new"


@posix
def test_permissions(tmp_path: Path) -> None:
    old_mask = os.umask(0o027)
    try:
        atomic_write_bytes(tmp_path / "new", b"")
    finally:
        os.umask(old_mask)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640
    (tmp_path / "new").chmod(0o600)
    atomic_write_bytes(tmp_path / "new", b"", overwrite=True)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o600
