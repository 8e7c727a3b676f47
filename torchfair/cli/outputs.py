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
    from ..topology import Topology

_NOT_ASKED = ("run", "name", "version")
_MESH_FORMATS = (".obj", ".off", ".ply", ".stl", ".glb", ".3dm")
_WITH_ATTRIBUTES = (".obj", ".3dm")
_TRIANGLES = (".stl", ".glb")


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
        missed: What was asked for beside the job and is not there, in words.
        interrupted: Whether what comes after the job was interrupted.
    """

    mesh: PolygonMesh
    options: dict[str, Any]
    start: Sequence[Any] = ()
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    settings: Any = None
    marks: Tensor | None = None
    report: dict[str, Any] = field(default_factory=dict)
    missed: list[str] = field(default_factory=list)
    interrupted: bool = False


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
        lines = self.polylines(result)
        request.notes += save_result(
            self.mesh, result.vertices, result.topology, request.mesh, force=self.force, polylines=lines,
            marks=bool(len(lines) or self.beside),
        )  # fmt: skip
        self._write(self.beside, request, result)

    def polylines(self, result: Any) -> Sequence[Tensor]:
        """Vertices of line elements of an OBJ file."""
        return ()

    def lines(self) -> list[str]:
        """What is said of what was written beside the mesh."""
        return []

    def write_others(self, report: Mapping[str, Any], request: Request, result: Any) -> None:
        """Writes the rest."""
        from ..io import write_report

        write_report(self.report, report, overwrite=self.force)
        self._write(self.pictures | self.others, request, result)

    def finish(
        self, request: Request, result: Any, lines: Sequence[str], report: Mapping[str, Any], missed: Sequence[str]
    ) -> None:
        """Says what came out, writes the rest, and says where it is and what was missed."""
        print("\n".join(lines), flush=True)
        self.write_others(report, request, result)
        print("\n".join([*(f"wrote {path}" for path in self.paths()), *missed]))

    def _write(self, files: Mapping[Path, Writer], request: Request, result: Any) -> None:
        for path, writer in files.items():
            writer(path, request, result, self.force)


def not_held(path: Path, source: PolygonMesh, *, same: bool, marks: bool) -> list[str]:
    """What of the file of a mesh another file does not hold, in words.

    Args:
        path: The other file.
        source: The mesh that was read.
        same: Whether the faces are those of the source.
        marks: Whether line elements of the source are carried on.
    """
    left_out = "" if source.attributes is None else source.attributes.left_out(path.suffix.lower(), same, marks)
    return [f"{path.name} does not hold {left_out} of the input"] if left_out else []


def save_result(
    path: Path,
    vertices: Tensor,
    topology: Topology,
    source: PolygonMesh,
    *,
    force: bool,
    polylines: Sequence[Tensor] = (),
    marks: bool = False,
) -> list[str]:
    """Writes a mesh that was made from another one, and says what of the file of that it does not hold.

    Groups, materials, texture coordinates and colours of an OBJ file are written back where the faces are the same;
    polygons are cut into triangles where the format has no others.

    Args:
        path: The file.
        vertices: (V, 3) of the mesh.
        topology: Of the mesh.
        source: What it was made from.
        force: Whether a file may be replaced.
        polylines: Line elements of an OBJ file.
        marks: Whether line elements of the source are carried on.
    """
    from ..io import RhinoParts, save_mesh

    suffix, notes = path.suffix.lower(), []
    attributes = source.attributes
    same = topology.corners.equal(source.topology.corners) and topology.face_offsets.equal(source.topology.face_offsets)
    notes += not_held(path, source, same=same, marks=marks)
    if suffix in _TRIANGLES and not topology.is_triangular:
        from ..topology import Topology
        from ..triangulation import triangulate

        notes.append(f"{path.name} holds its polygons cut into triangles: {suffix} files have no others")
        topology = Topology.from_faces(triangulate(vertices, topology).triangles, topology.num_vertices)
    kept = attributes if same else None
    if isinstance(attributes, RhinoParts):
        kept = attributes if same else attributes.of_other_faces(topology.num_faces)
    if isinstance(kept, RhinoParts) != (suffix == ".3dm") or suffix not in _WITH_ATTRIBUTES:
        kept = None
    save_mesh(path, vertices, topology, overwrite=force, polylines=polylines, attributes=kept)
    return notes


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say where they go."""
    add = parser.add_argument
    add(
        "-o",
        "--output",
        required=True,
        metavar="OUTPUT",
        help="mesh file to write (OBJ, OFF, PLY, STL, GLB or 3DM)",
    )
    add("--results", metavar="FOLDER", help="folder of report.json and all else (default: that of OUTPUT)")
    add("--no-pictures", action="store_true", help="write no pictures")
    add("--force", action="store_true", help="replace files that exist")


def asked_for(arguments: argparse.Namespace) -> dict[str, Any]:
    """Arguments by name for a report, without settings."""
    return {name: value for name, value in vars(arguments).items() if name not in _NOT_ASKED and "." not in name}


def refuse_unknown_format(path: Path) -> None:
    """Refuses names of mesh files that do not say how to write them."""
    if path.suffix.lower() not in _MESH_FORMATS:
        raise CommandError(f"cannot write '{path}': choose a name that ends in {', '.join(_MESH_FORMATS)}")


def refuse_existing(paths: Sequence[Path], *, force: bool) -> None:
    """Refuses files that exist, unless they may be replaced."""
    existing = [str(path) for path in paths if path.exists()]
    if existing and not force:
        raise CommandError(f"{', '.join(existing)} exists: choose another folder, or --force to replace")
