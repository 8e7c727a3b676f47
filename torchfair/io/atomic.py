"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from pathlib import Path

from ..errors import MeshFileError


def atomic_write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> None:
    """Writes ``text`` in UTF-8 like :func:`atomic_write_bytes`, line ends as they are."""
    atomic_write_bytes(path, text.encode("utf-8"), overwrite=overwrite)


def atomic_write_bytes(path: str | os.PathLike[str], data: bytes, *, overwrite: bool = False) -> None:
    """Writes ``data`` to ``path`` so that no reader ever sees half a file.

    The bytes go to a temporary file in the same folder, are flushed to the disk, and then take the name
    ``path`` in one step. Whatever goes wrong, the temporary file is removed and a file that was there before
    is untouched. A symbolic link is followed. Without ``overwrite`` an existing path is refused even if it
    came into being during the call.

    Raises:
        MeshFileError: if the folder is missing, the path exists (without ``overwrite``) or is not a regular
            file, or the system refuses.
    """
    shown = Path(path)
    try:
        target = Path(os.path.realpath(shown)) if overwrite else shown
        _check_target(shown, target, overwrite)
        _write_and_rename(target, data, overwrite)
    except FileExistsError:
        raise _exists(shown) from None
    except OSError as error:
        raise MeshFileError(shown, f"cannot be written ({error.strerror or error})") from None
    except ValueError as error:  # a NUL character in the path
        if isinstance(error, MeshFileError):
            raise
        raise MeshFileError(shown, f"is no usable file name ({error})") from None


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


def _write_and_rename(target: Path, data: bytes, overwrite: bool) -> None:
    temporary = target.parent / f".torchfair-{secrets.token_hex(8)}.tmp"
    try:
        # os.open rather than tempfile: the file gets the permissions that the user's umask asks for
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(temporary, flags, 0o666), "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if overwrite:
            if target.exists():
                shutil.copymode(target, temporary)
            os.replace(temporary, target)
        else:
            _claim_name(temporary, target)
    finally:
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()


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
