"""What files are called that belong to an output: ``roof.obj`` has ``roof.report.json`` and ``roof.edges.png``."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FILES = "files"
"""Entry of a report: the files that belong to it."""


@dataclass(frozen=True)
class OutputNames:
    """Where an output goes, and what belongs to it.

    Attributes:
        folder: Of the output.
        stem: Its name without an extension, with which the names of all others begin.
        suffix: Its extension.
        side_folder: Of the report, pictures and the like.
    """

    folder: Path
    stem: str
    suffix: str
    side_folder: Path

    @classmethod
    def of(cls, output: str | os.PathLike[str], side_folder: str | None = None) -> OutputNames:
        """Those of a file, and of side files in the same folder or another one."""
        path = Path(output)
        return cls(path.parent, path.stem, path.suffix, path.parent if side_folder is None else Path(side_folder))

    @property
    def output(self) -> Path:
        """The file itself."""
        return self.beside(self.suffix)

    def beside(self, end: str) -> Path:
        """What goes where the output goes: ``.edges.json``, ``-quads.obj``."""
        return self.folder / f"{self.stem}{end}"

    def side(self, end: str) -> Path:
        """What is told or drawn of the output: ``report.json``, ``edges.png``."""
        return self.side_folder / f"{self.stem}.{end}"


def input_stem(name: str) -> str:
    """With what names of files begin that are told or drawn of an input."""
    return name.removeprefix("example:") if name.startswith("example:") else Path(name).stem


def listed(paths: Sequence[Path], report: Path) -> list[str]:
    """Paths for the report that they belong to, as seen from its folder."""
    return sorted(os.path.relpath(path, report.parent) for path in paths)


def listed_in(report: Path, stem: str) -> list[Path]:
    """The side files of an earlier run that its report lists, whose names begin with a stem; those that are there."""
    names = _document(report).get(FILES)
    names = [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
    paths = [report.parent / name for name in names if Path(name).name.startswith(f"{stem}.")]
    return [path for path in paths if path.is_file() and not path.is_symlink()]


def owner(report: Path) -> Path | None:
    """The mesh that a report is of; None if that is not known."""
    document = _document(report)
    request = document.get("request", {})
    name = request.get("output") if isinstance(request, Mapping) and request else document.get("file")
    return Path(name) if isinstance(name, str) else None


def _document(report: Path) -> Mapping[str, Any]:
    try:
        document = json.loads(report.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, Mapping) else {}
