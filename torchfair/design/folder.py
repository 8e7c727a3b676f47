"""The folder that a design was started in: what is in it to open, and what may be written where."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from .autosave import autosave_path
from .commands import CommandRefused
from .session_file import SUFFIX

OPENS = (".obj", ".ply", ".off", ".stl", ".3dm", ".dxf", ".glb", ".gltf", SUFFIX)
"""Extensions of files that are listed and opened."""
_MOST = 500


class Folder:
    """A folder, without what lies below it.

    Args:
        path: The folder.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path).resolve()

    def listing(self) -> list[dict[str, Any]]:
        """Files that can be opened, by name; hidden ones and links to elsewhere are left out."""
        found = []
        try:
            entries = sorted(self.path.iterdir())
        except OSError:
            return []
        for entry in entries:
            if entry.name.startswith(".") or entry.suffix.lower() not in OPENS:
                continue
            if entry.resolve().parent == self.path and entry.is_file():
                kind = "session" if entry.suffix.lower() == SUFFIX else "mesh"
                found.append({"name": entry.name, "bytes": entry.stat().st_size, "kind": kind})
        return found[:_MOST]

    def kept(self, path: Path) -> Path | None:
        """What was kept of the edits of a mesh file and never saved, if it is newer than the file."""
        kept = autosave_path(self.path, path.stem)
        try:
            return kept if kept.is_file() and kept.stat().st_mtime > path.stat().st_mtime else None
        except OSError:
            return None

    def to_read(self, source: str, *, typed: bool) -> Path:
        """The file that a command names: in this folder, or anywhere if a person typed its path.

        Raises:
            CommandRefused: it is elsewhere, or no file that can be opened.
        """
        path = self._place(source, typed=typed)
        if path.suffix.lower() not in OPENS:
            raise CommandRefused(f"{path.name}: can be opened are {', '.join(OPENS)}")
        if not path.is_file():
            raise CommandRefused(f"{source}: there is no such file")
        return path

    def to_write(self, name: str, suffix: str, *, typed: bool) -> Path:
        """Where a command wants to write: in this folder, or anywhere if a person typed the path.

        Args:
            name: Of the file; the extension is added where it is missing.
            suffix: The extension that it must have.
            typed: Whether a person typed it as a path.

        Raises:
            CommandRefused: it is elsewhere, hidden, or has another extension.
        """
        path = self._place(name, typed=typed)
        if path.suffix.lower() != suffix:
            path = path.with_name(path.name + suffix)
        if path.name.startswith("."):
            raise CommandRefused("a name must not begin with a dot")
        return path

    def _place(self, name: str, *, typed: bool) -> Path:
        if typed:
            return Path(os.path.abspath(self.path / os.path.expanduser(name)))
        if name in (".", "..") or any(sign in name for sign in "/\\:\0") or not name.isprintable():
            raise CommandRefused("a name is that of a file in the folder, without any path")
        path = self.path / name
        if path.is_symlink() and path.resolve().parent != self.path:
            raise CommandRefused(f"{name}: leads out of the folder")
        return path
