"""Files that are written but for their names, which they take one by one or together."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from .errors import MeshFileError


@dataclass(frozen=True)
class StagedFile:
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

    @property
    def has_name(self) -> bool:
        """Whether it has taken its name."""
        if not self.temporary.exists():
            return True
        return self.target.exists() and self.target.samefile(self.temporary)


def staged(path: Path, data: bytes, overwrite: bool) -> StagedFile:
    """Writes bytes beside ``path``, on the disk when this returns.

    Raises:
        MeshFileError: that is not possible, or the name is taken.
    """
    with _faults_of(path):
        target = Path(os.path.realpath(path)) if overwrite else path
        _check_target(path, target, overwrite)
        return StagedFile(path, target, overwrite, _temporary(target, data))


def take_names(files: list[StagedFile]) -> None:
    """Gives all files their names; if one cannot have it, all is put back.

    Raises:
        MeshFileError: one cannot have it.
    """
    before: list[tuple[StagedFile, Path | None]] = []
    try:
        for file in files:
            with _faults_of(file.shown):
                before.append((file, _second_name(file) if len(files) > 1 else None))
                file.take_name()
    except BaseException:
        for file, old in reversed(before):
            with contextlib.suppress(OSError):
                if file.has_name:
                    file.target.unlink() if old is None else os.replace(old, file.target)
        raise
    finally:
        drop([*(file.temporary for file in files), *(old for _, old in before if old is not None)])


def drop(files: Iterable[Path]) -> None:
    """Removes files that are there."""
    for file in files:
        with contextlib.suppress(FileNotFoundError):
            file.unlink()


def _second_name(file: StagedFile) -> Path | None:
    """Another name, or a copy, of the file that is to be replaced; None if there is none."""
    if not file.overwrite or not file.target.exists():
        return None
    other = _unused(file.target.parent)
    try:
        os.link(file.target, other)
    except OSError:
        shutil.copy2(file.target, other)
    return other


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
        drop([temporary])
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
