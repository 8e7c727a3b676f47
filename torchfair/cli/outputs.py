"""The files that a job writes."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import TorchfairError
from .element_tables import add_tables, table_writers
from .elsewhere import places
from .errors import CommandError
from .output_checks import make_folders, refuse_report_of_another, refuse_taken, refuse_unknown_format, remove
from .output_names import FILES, OutputNames, listed, listed_in
from .request import Report, Request, Writer
from .result_files import save_result
from .views import LABELS, add_views

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh

_NOT_ASKED = ("run", "check", "name", "version", "quiet")
_BYTES = 200  # of a vertex and its faces as text, about
_BYTES_OF_OTHERS = 1_000_000  # of a report or a picture


def draw_labels(path: Path, request: Request, result: Any, overwrite: bool) -> None:
    """The mesh that was read, with the numbers that options take."""
    from ..viewing import picture_labels

    mesh, view = request.mesh, request.view
    picture_labels(path, mesh.vertices, mesh.topology, names=mesh.names, view=view, overwrite=overwrite)


class Outputs:
    """Mesh, report and others, all named after the mesh.

    Mesh and report are written first, and together: both are there, or neither, and pictures of an earlier run are gone
    with its report. Where they cannot be written they are kept elsewhere, see :func:`~.elsewhere.places`.

    Args:
        arguments: Of the command.
        pictures: Writers by end of the name.

    Attributes:
        names: Where they go; elsewhere, once they could not be written there.
        beside: Writers of what is written with the mesh, by end of the name.
        late: Writers of what :meth:`more` has made, beside the mesh, too.
        pictures, others: Writers of what is written at last, by end of the name.
        tables: Writers of tables by path, which is asked for.
        force: Whether files may be replaced.
    """

    def __init__(self, arguments: argparse.Namespace, pictures: Mapping[str, Writer]) -> None:
        self.names, self.force = OutputNames.of(arguments.output, arguments.results), arguments.force
        drawn = {**pictures, **({LABELS: draw_labels} if getattr(arguments, "label", False) else {})}
        self.pictures: dict[str, Writer] = {} if arguments.no_pictures else drawn
        self.tables: dict[Path, Writer] = dict(table_writers(arguments))
        self.beside: dict[str, Writer] = {}
        self.late: dict[str, Writer] = {}
        self.others: dict[str, Writer] = {}
        self._faults: list[str] = []
        self._lacking: list[Path] = []

    @property
    def mesh(self) -> Path:
        """The mesh."""
        return self.names.output

    @property
    def report(self) -> Path:
        """The report."""
        return self.names.side("report.json")

    def paths(self, names: OutputNames | None = None) -> list[Path]:
        """All files, in the order in which they are written."""
        names = names or self.names
        ends = [*self.beside, *self.late]
        told = ["report.json", *self.pictures, *self.others]
        return [names.output, *(names.beside(end) for end in ends), *(names.side(end) for end in told), *self.tables]

    # ---- before the job --------------------------------------------------------------------------------

    def prepare(self) -> None:
        """Refuses unknown mesh formats, names that are taken, and places where nothing can be written."""
        refuse_unknown_format(self.mesh)
        refuse_taken(self.paths(), force=self.force)
        refuse_report_of_another(self.report, self.mesh)

    def make_folders(self, mesh: PolygonMesh, levels: int) -> None:
        """Makes the folders of all files, so that a solve does not end with nowhere to write."""
        size = _BYTES * mesh.topology.num_vertices * 4**levels + _BYTES_OF_OTHERS * len(self.paths())
        make_folders(self.paths(), size)

    # ---- after it --------------------------------------------------------------------------------------

    def save(self, request: Request, result: Any, report: Report) -> None:
        """Writes what must not be lost; to be called where Ctrl-C waits."""
        asked, old, fault = self.names, listed_in(self.report, self.names.stem) if self.force else [], None
        for names in places(asked, self.paths):
            self.names = names
            try:
                notes = self._mesh_and_report(request, result, report)
            except (TorchfairError, OSError) as error:
                fault = fault or error
                self.force = False
                continue
            request.notes += notes
            if fault is None:
                self._remove([*old, *(path for path in self.paths() if self.force)], {self.mesh, self.report})
            else:
                self._faults.append(f"{_words(fault)}; the mesh is {self.mesh} instead, its report {self.report}")
            return
        assert fault is not None
        raise fault

    def save_more(self, request: Request, result: Any, report: Report) -> None:
        """Makes what takes long and writes it, with the report anew."""
        try:
            if self.more(request, result):
                self._attempt(partial(self._together, self.late, request, result, report), self.report)
        except KeyboardInterrupt:
            request.interrupted = True

    def more(self, request: Request, result: Any) -> bool:
        """Makes what takes long once the mesh is safe; whether the report has to be written anew."""
        return False

    def polylines(self, result: Any) -> Sequence[Tensor]:
        """Vertices of line elements of an OBJ file."""
        return ()

    def lines(self) -> list[str]:
        """What is said of what was written beside the mesh."""
        return []

    def finish(self, request: Request, result: Any, lines: Sequence[str], missed: Sequence[str]) -> None:
        """Says what came out, draws and writes the rest, and says where it is and what was missed.

        Raises:
            CommandError: something could not be written where it was to go; says what, and where it is instead.
        """
        print("\n".join(lines), flush=True)
        rest = {self.names.side(end): writer for end, writer in (self.pictures | self.others).items()}
        rest |= self.tables
        try:
            if request.interrupted:
                raise KeyboardInterrupt
            for path, writer in rest.items():
                self._attempt(partial(writer, path, request, result, self.force), path)
        except KeyboardInterrupt:
            request.interrupted = True
            self._lacking += [path for path in rest if not path.exists()]
        there = [path for path in self.paths() if path not in self._lacking]
        lost = [f"not written: {path}" for path in self._lacking] if request.interrupted else []
        print("\n".join([*(f"wrote {path}" for path in there), *lost, *missed]))
        if self._faults:
            raise CommandError("; ".join(self._faults))

    def _mesh_and_report(self, request: Request, result: Any, report: Report) -> list[str]:
        """Writes both, and what stands beside the mesh; what the file of the mesh does not hold."""
        from ..io import written_together

        lines = self.polylines(result)
        with written_together():
            notes = save_result(
                self.mesh, result.vertices, result.topology, request.mesh, force=self.force, polylines=lines,
                marks=bool(len(lines) or self.beside),
            )  # fmt: skip
            self._together(self.beside, request, result, report)
        return notes

    def _together(self, beside: Mapping[str, Writer], request: Request, result: Any, report: Report) -> None:
        """Writes files beside the mesh and the report, all or none."""
        from ..io import write_report, written_together

        with written_together():
            for end, writer in beside.items():
                writer(self.names.beside(end), request, result, self.force)
            entries = {**report(), FILES: listed(self.paths(), self.report)}
            write_report(self.report, entries, overwrite=self.force or beside is self.late)

    def _remove(self, files: Sequence[Path], new: set[Path]) -> None:
        """Removes files of an earlier run, which are not of this one."""
        new |= {self.names.beside(end) for end in self.beside}
        remove(set(files) - new - {self.names.beside(end) for end in self.late})

    def _attempt(self, write: Callable[[], object], path: Path) -> None:
        """Writes something that one can do without; takes note if that fails."""
        try:
            write()
        except (TorchfairError, OSError) as error:
            self._faults.append(_words(error))
            self._lacking.append(path)


def _words(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'}: {error.strerror or error}"
    return str(error)


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say where they go."""
    add = parser.add_argument
    add("-o", "--output", required=True, metavar="OUTPUT", help="mesh file to write (OBJ, OFF, PLY, STL, GLB, 3DM or "
        "DXF), or a folder; what belongs to it is named after it: NAME.report.json and others")  # fmt: skip
    add("--results", metavar="FOLDER", help="folder of NAME.report.json and all else (default: that of OUTPUT)")
    add("--no-pictures", action="store_true", help="write no pictures")
    add_views(parser)
    add_tables(parser, "the result")
    add("--force", action="store_true", help="replace files that exist, and remove pictures of the earlier run")


def asked_for(arguments: argparse.Namespace) -> dict[str, Any]:
    """Arguments by name for a report, without settings."""
    return {name: value for name, value in vars(arguments).items() if name not in _NOT_ASKED and "." not in name}
