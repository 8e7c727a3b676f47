"""Files that appear whole or not at all, one by one or several together."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from ._staged import StagedFile, drop, staged, take_names

_WAITING: ContextVar[list[StagedFile] | None] = ContextVar("files that wait for each other", default=None)


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
    file, waiting = staged(Path(path), data, overwrite), _WAITING.get()
    if waiting is not None:
        waiting.append(file)
    else:
        take_names([file])


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
    files: list[StagedFile] = []
    token = _WAITING.set(files)
    try:
        yield
    except BaseException:
        drop(file.temporary for file in files)
        raise
    finally:
        _WAITING.reset(token)
    take_names(files)
