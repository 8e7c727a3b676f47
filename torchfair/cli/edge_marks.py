"""Marked edges, such as principal ones, that go with a mesh from file to file and to finer levels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MeshFileError
from .outputs import Outputs
from .request import Request

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping, Sequence

    from torch import Tensor

    from ..io import PolygonMesh
    from ..subdivision import Refinement
    from ..topology import Topology
    from .request import Report, Writer


def marks_file(arguments: argparse.Namespace) -> Path | None:
    """The file that marks edges of INPUT: that of ``--labels``, else INPUT or the one beside it if there are marks."""
    from ..io import edge_labels_path

    name, given = arguments.input, getattr(arguments, "labels", None)
    if given is not None:
        return Path(given)
    if name.startswith("example:"):
        return None
    path = edge_labels_path(name)
    if path.suffix.lower() == ".obj":
        return path if _has_lines(path) else None
    return path if path.exists() else None


def end_of_marks(output: Path) -> str | None:
    """End of the name of the file that is to hold marks of edges beside a mesh; None where the mesh holds them."""
    return None if output.suffix.lower() == ".obj" else ".edges.json"


def _has_lines(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return any(line.lstrip().startswith((b"l ", b"l\t")) for line in file)
    except OSError as error:
        raise MeshFileError(path, str(error.strerror or error)) from None


def are_principal(topology: Topology, marks: Tensor) -> bool:
    """Whether two opposite edges are marked at every regular vertex of a triangle mesh."""
    from ..principal import PrincipalEdges

    if not topology.is_triangular:
        return False
    edges = PrincipalEdges(topology, marks)
    return bool(edges.stars().vertices.numel()) and not edges.exceptions.numel()


def carried(lines: str, marks: Tensor, step: Refinement) -> tuple[Tensor, str]:
    """Marks of the finer mesh, and what was decided, in words.

    Args:
        lines: parallel, along, or auto.
        marks: (E,) bool, of the coarse mesh.
        step: from coarse to fine.
    """
    parallel = lines == "parallel" or (lines == "auto" and are_principal(step.coarse, marks))
    fine = step.carry_edge_labels(marks, parallel=parallel)
    words = "parts of marked edges and edges parallel to them" if parallel else "parts of marked edges"
    return fine, f"{int(marks.sum())} marked edges to {int(fine.sum())}: {words}"


def read_marks(mesh: PolygonMesh, arguments: argparse.Namespace) -> Tensor | None:
    """(E,) bool: marked edges of INPUT; None without."""
    from ..io import load_edge_labels

    file = marks_file(arguments)
    if file is None:
        return None
    return load_edge_labels(file, mesh.topology, vertex_map=mesh.vertex_map)


class MarkedOutputs(Outputs):
    """The mesh with the marks of INPUT: as line elements of an OBJ file, in a file beside others.

    Args:
        arguments, pictures: See the base class.
    """

    def __init__(self, arguments: argparse.Namespace, pictures: Mapping[str, Writer]) -> None:
        super().__init__(arguments, pictures)
        self._marks: Tensor | None = None
        beside = end_of_marks(self.mesh)
        self._in_mesh = beside is None
        if beside is not None and Path(arguments.input).is_file() and marks_file(arguments) is not None:
            self.beside = {beside: self._save}

    def save(self, request: Request, result: Any, report: Report) -> None:
        """See the base class."""
        from ..subdivision import hybrid

        if request.marks is None:
            self.beside = {}
        else:
            self._marks = request.marks
            for level in result.levels[:-1]:
                self._marks, _ = carried("auto", self._marks, hybrid(level.topology))
        super().save(request, result, report)

    def polylines(self, result: Any) -> Sequence[Tensor]:
        """Marked edges, unless they stand in a file beside."""
        from ..polylines import polylines_along

        return polylines_along(result.topology, self._marks) if self._marks is not None and self._in_mesh else ()

    def _save(self, path: Path, request: Request, result: Any, overwrite: bool) -> None:
        from ..io import save_edge_labels

        if self._marks is not None:
            save_edge_labels(path, result.topology, self._marks, overwrite=overwrite)
