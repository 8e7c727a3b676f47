"""Whether files can be written where they are to go, asked before any work."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

from .errors import CommandError
from .output_names import owner

MESH_FORMATS = (".obj", ".off", ".ply", ".stl", ".glb", ".3dm", ".dxf")


def refuse_unknown_format(path: Path) -> None:
    """Refuses names of mesh files that do not say how to write them."""
    if path.suffix.lower() not in MESH_FORMATS:
        raise CommandError(f"cannot write '{path}': choose a name that ends in {', '.join(MESH_FORMATS)}")


def refuse_taken(paths: Sequence[Path], *, force: bool) -> None:
    """Refuses files that exist, unless they may and can be replaced; and folders that cannot be made or written in."""
    existing = [path for path in paths if os.path.lexists(path)]
    if existing and not force:
        names = ", ".join(map(str, existing))
        raise CommandError(f"{names} exists: choose another name or folder, or --force to replace")
    for path in existing:
        _refuse_irreplaceable(path)
    for folder in {path.parent for path in paths}:
        _refuse_impossible_folder(folder)


def refuse_report_of_another(report: Path, mesh: Path) -> None:
    """Refuses to replace the report of another mesh that is still there, such as one of another format."""
    of = owner(report)
    if of is None:
        return
    beside = os.path.realpath(report.parent) == os.path.realpath(mesh.parent)  # folders may have been copied or moved
    for other in (mesh.with_name(of.name), *(() if beside else (of,))):
        if other.exists() and not _same(other, mesh):
            raise CommandError(f"{report} is the report of {other}: choose another name, or --results FOLDER")


def make_folders(paths: Iterable[Path], room: int) -> None:
    """Makes the folders of files, and finds out whether they can be written in.

    Args:
        paths: The files.
        room: Bytes that are needed, about.

    Raises:
        CommandError: a folder cannot be made or written in, or its disk is too full.
    """
    for folder in {Path(os.path.realpath(path)).parent for path in paths}:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / f".torchfair-{secrets.token_hex(8)}.tmp"
            probe.write_bytes(b"?")
            probe.unlink()
            free = shutil.disk_usage(folder).free
        except OSError as error:
            raise CommandError(f"{folder}: cannot be written in ({error.strerror or error})") from None
        if free < room:
            raise CommandError(
                f"{folder}: {_bytes(free)} are free on its disk, and about {_bytes(room)} needed: make room, or choose "
                "another folder"
            )


def remove(paths: Iterable[Path]) -> None:
    """Removes files, as far as that is possible."""
    for path in paths:
        with contextlib.suppress(OSError):
            path.unlink()


def _refuse_irreplaceable(path: Path) -> None:
    if path.is_dir():
        raise CommandError(f"{path} is a folder: give the name of a file")
    if path.exists() and not path.is_file():
        raise CommandError(f"{path} is not a regular file, so it cannot be replaced")
    real = Path(os.path.realpath(path))
    if real.is_symlink() or not real.parent.is_dir():
        raise CommandError(f"{path} is a link that leads nowhere")


def _refuse_impossible_folder(folder: Path) -> None:
    while not os.path.lexists(folder):
        folder = folder.parent
    if not folder.is_dir():
        raise CommandError(f"{folder} is no folder, so nothing can be written in it")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise CommandError(f"{folder}: cannot be written in (Permission denied)")


def _same(one: Path, other: Path) -> bool:
    return other.exists() and one.samefile(other)


def _bytes(number: int) -> str:
    return f"{number / 1e6:.3g} MB"
