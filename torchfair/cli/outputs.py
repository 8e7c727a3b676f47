"""The files that a job writes."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import CommandError

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh

_MESH_FORMATS = (".obj", ".off", ".ply")


@dataclass
class Request:
    """What a job is to do.

    Attributes:
        mesh: Where it starts.
        options: Arguments of the function that does it, by name, beside settings and callback.
        start: Its first arguments; by default vertices and topology of the mesh.
        notes: What was decided while reading, in words.
        warnings: What is likely to fail, and what to do instead; said before it is tried.
        marks: Marked edges (E,) of the mesh, which go with it; None for none.
        settings: To solve with; by default those that options ask for.
        report: Entries of ``report.json`` beside those that all jobs have.
    """

    mesh: PolygonMesh
    options: dict[str, Any]
    start: Sequence[Any] = ()
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    settings: Any = None
    marks: Tensor | None = None
    report: dict[str, Any] = field(default_factory=dict)


Writer = Callable[[Path, Any, Any, bool], object]
"""Writes one file from its path, the request, the result, and whether it may replace a file."""


class Outputs:
    """Mesh, report and others; each is written whole or not at all, the mesh first.

    Args:
        arguments: Of the command.
        pictures: Writers by name of the file.

    Attributes:
        mesh, folder, report: Where they go.
        beside: Writers by path of what is written with the mesh.
        others: Writers by path of what is written at last.
        force: Whether files may be replaced.
    """

    def __init__(self, arguments: argparse.Namespace, pictures: Mapping[str, Writer]) -> None:
        self.mesh, self.force = Path(arguments.output), arguments.force
        self.folder = self.mesh.parent if arguments.results is None else Path(arguments.results)
        self.report = self.folder / "report.json"
        drawn = {} if arguments.no_pictures else pictures
        self.pictures = {self.folder / name: writer for name, writer in drawn.items()}
        self.beside: dict[Path, Writer] = {}
        self.others: dict[Path, Writer] = {}

    def paths(self) -> list[Path]:
        """All files, in the order in which they are written."""
        return [self.mesh, *self.beside, self.report, *self.pictures, *self.others]

    def prepare(self) -> None:
        """Refuses unknown mesh formats and, unless forced, files that exist."""
        refuse_unknown_format(self.mesh)
        refuse_existing(self.paths(), force=self.force)

    def make_folders(self) -> None:
        """Makes the folders of all files, so that a solve does not end with nowhere to write."""
        for folder in {self.mesh.parent, self.folder}:
            folder.mkdir(parents=True, exist_ok=True)

    def write_mesh(self, request: Request, result: Any) -> None:
        """Writes what must not be lost."""
        from ..io import save_mesh

        lines = self.polylines(result)
        save_mesh(self.mesh, result.vertices, result.topology, overwrite=self.force, polylines=lines)
        self._write(self.beside, request, result)

    def polylines(self, result: Any) -> Sequence[Tensor]:
        """Vertices of line elements of an OBJ file."""
        return ()

    def write_others(self, report: Mapping[str, Any], request: Request, result: Any) -> None:
        """Writes the rest."""
        from ..io import write_report

        write_report(self.report, report, overwrite=self.force)
        self._write(self.pictures | self.others, request, result)

    def _write(self, files: Mapping[Path, Writer], request: Request, result: Any) -> None:
        for path, writer in files.items():
            writer(path, request, result, self.force)


def refuse_unknown_format(path: Path) -> None:
    """Refuses names of mesh files that do not say how to write them."""
    if path.suffix.lower() not in _MESH_FORMATS:
        raise CommandError(f"cannot write '{path}': choose a name that ends in {', '.join(_MESH_FORMATS)}")


def refuse_existing(paths: Sequence[Path], *, force: bool) -> None:
    """Refuses files that exist, unless they may be replaced."""
    existing = [str(path) for path in paths if path.exists()]
    if existing and not force:
        raise CommandError(f"{', '.join(existing)} exists: choose another folder, or --force to replace")
