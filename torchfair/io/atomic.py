"""Files that appear whole or not at all, one by one or several together."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from ..errors import MeshFileError

_WAITING: ContextVar[list[_Written] | None] = ContextVar("files that wait for each other", default=None)


def atomic_write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> None:
    """Writes ``text`` in UTF-8 like :func:`atomic_write_bytes`, line ends as they are."""
    atomic_write_bytes(path, text.encode("utf-8"), overwrite=overwrite)


def atomic_write_bytes(path: str | os.PathLike[str], data: bytes, *, overwrite: bool = False) -> None:
    """Writes ``data`` to ``path`` so that no reader ever sees half a file.

    The bytes go to a temporary file in the same folder, are flushed to the disk, and then take the name
    ``path`` in one step; within :func:`written_together` at its end. Whatever goes wrong, the temporary file is removed
    and a file that was there before is untouched. A symbolic link is followed. Without ``overwrite`` an existing path
    is refused even if it came into being during the call.

    Raises:
        MeshFileError: if the folder is missing, the path exists (without ``overwrite``) or is not a regular
            file, or the system refuses.
    """
    shown = Path(path)
    with _faults_of(shown):
        target = Path(os.path.realpath(shown)) if overwrite else shown
        _check_target(shown, target, overwrite)
        written = _Written(shown, target, overwrite, _temporary(target, data))
    waiting = _WAITING.get()
    if waiting is not None:
        waiting.append(written)
    else:
        _take_names([written])


@contextmanager
def written_together() -> Iterator[None]:
    """Files that are written in its body take their names at its end: all of them, or none.

    Where one cannot be written, for want of space, say, or because its name was taken meanwhile, those that would be
    replaced are as they were, and the error is raised. Functions of this package that write, such as :func:`save_mesh`
    and :func:`write_report`, and pictures take part; within another such body it is the same as that.

    Raises:
        MeshFileError: a file cannot take its name.

    Example::

        with written_together():
            save_mesh("roof.obj", vertices, topology, overwrite=True)
            write_report("roof.report.json", report, overwrite=True)
    """
    if _WAITING.get() is not None:
        yield
        return
    written: list[_Written] = []
    token = _WAITING.set(written)
    try:
        yield
    except BaseException:
        _drop(file.temporary for file in written)
        raise
    finally:
        _WAITING.reset(token)
    _take_names(written)


@dataclass(frozen=True)
class _Written:
    """A file that is written but for its name.

    Attributes:
        shown: Its name as it was given.
        target: The same without links.
        overwrite: Whether it may replace a file.
        temporary: Its name until then.
    """

    shown: Path
    target: Path
    overwrite: bool
    temporary: Path

    def take_name(self) -> None:
        """Gives it its name."""
        if not self.overwrite:
            _claim_name(self.temporary, self.target)
            return
        if self.target.exists():
            shutil.copymode(self.target, self.temporary)
        os.replace(self.temporary, self.target)


def _take_names(files: list[_Written]) -> None:
    """Gives all files their names; if one cannot have it, all is put back."""
    before: list[tuple[_Written, Path | None]] = []
    try:
        for file in files:
            with _faults_of(file.shown):
                old = _second_name(file) if len(files) > 1 else None
                before.append((file, old))
                try:
                    file.take_name()
                except BaseException:
                    before.pop()
                    if old is not None:
                        old.unlink()
                    raise
    except BaseException:
        for file, old in reversed(before):
            with contextlib.suppress(OSError):
                file.target.unlink() if old is None else os.replace(old, file.target)
        raise
    finally:
        _drop([*(file.temporary for file in files), *(old for _, old in before if old is not None)])


def _second_name(file: _Written) -> Path | None:
    """Another name of the file that is to be replaced; None if there is none, or where files have one name only."""
    if not file.overwrite or not file.target.exists():
        return None
    other = _unused(file.target.parent)
    try:
        os.link(file.target, other)
    except OSError:
        shutil.copy2(file.target, other)
    return other


def _drop(files: Iterator[Path] | list[Path]) -> None:
    for file in files:
        with contextlib.suppress(FileNotFoundError):
            file.unlink()


@contextmanager
def _faults_of(path: Path) -> Iterator[None]:
    """Errors of the system name the file."""
    try:
        yield
    except FileExistsError:
        raise _exists(path) from None
    except OSError as error:
        raise MeshFileError(path, f"cannot be written ({error.strerror or error})") from None
    except ValueError as error:  # a NUL character in the path
        if isinstance(error, MeshFileError):
            raise
        raise MeshFileError(path, f"is no usable file name ({error})") from None


def _exists(path: Path) -> MeshFileError:
    return MeshFileError(path, "exists already. Choose another name, or ask for overwriting (overwrite=True, --force)")


def _check_target(shown: Path, target: Path, overwrite: bool) -> None:
    if not target.parent.is_dir():
        raise MeshFileError(shown, f"the folder {target.parent} does not exist. Create it first")
    if target.is_dir():
        raise MeshFileError(shown, "is a folder. Give the name of a file in it")
    if os.path.lexists(target):
        if not overwrite:
            raise _exists(shown)
        if not target.is_file():
            raise MeshFileError(shown, "is not a regular file, so it cannot be replaced")


def _unused(folder: Path) -> Path:
    return folder / f".torchfair-{secrets.token_hex(8)}.tmp"


def _temporary(target: Path, data: bytes) -> Path:
    """The bytes in a file beside ``target``."""
    temporary = _unused(target.parent)
    try:
        # os.open rather than tempfile: the file gets the permissions that the user's umask asks for
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(temporary, flags, 0o666), "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        _drop([temporary])
        raise
    return temporary


def _claim_name(temporary: Path, target: Path) -> None:
    """Gives ``temporary`` the name ``target``; FileExistsError if that name is taken."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: claim the name with an empty file, then replace that
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
        try:
            os.replace(temporary, target)
        except OSError:
            target.unlink()
            raise
