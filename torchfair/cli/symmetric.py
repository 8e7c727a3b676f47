"""``torchfair symmetric``: makes a triangle mesh principal-symmetric, refines it, and unrolls strips along it."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import TorchfairError
from .chosen_vertices import NUMBERS, ChosenVertices
from .edge_marks import end_of_marks
from .inputs import (
    add_fixed,
    add_handles,
    add_levels,
    add_reference,
    add_repair,
    read_fixed,
    read_handles,
    read_input,
    read_reference,
)
from .job_command import JobCommand
from .outputs import Outputs
from .pictures import edges_of
from .reading import in_numbers_of
from .request import Request, Writer
from .result_files import not_held
from .several import add_inputs
from .strips import StripFiles, add_strips
from .symmetric_inputs import add_labels, polyline_vertices, read_principal_edges, slide_warnings, vertex_mask
from .symmetric_quads import even_settings, read_quads

if TYPE_CHECKING:
    from torch import Tensor

    from ..formfinding import JobResult, SymmetricLevel


def _principal(path: Path, request: Request, result: Any, overwrite: bool) -> None:
    from ..viewing import picture_principal_edges

    vertices, edges = request.start
    meshes = {"start": (vertices, edges), "result": (result.vertices, result.levels[-1].principal)}
    picture_principal_edges(path, meshes, view=request.view, overwrite=overwrite)


def _labels(path: Path, request: Request, result: Any, overwrite: bool) -> None:
    from ..io import save_edge_labels

    save_edge_labels(path, result.topology, result.levels[-1].principal.mask, overwrite=overwrite)


class SymmetricCommand(JobCommand):
    """Designs principal-symmetric meshes."""

    job = "symmetric"
    purpose = "design a principal-symmetric mesh"
    description = (
        "Makes a triangle mesh, or a quad mesh cut by diagonals, principal-symmetric: one third of its edges follow "
        "principal curvature lines and the others lie symmetrically to them, which represents saddles best. Pulls "
        "vertices, refines the mesh, and writes developable strips along the principal edges. In an OBJ file principal "
        "edges are line elements, beside others stands NAME.edges.json."
    )
    option_names: ClassVar[Mapping[str, str]] = {"most_steps": "steps"}
    pictures: ClassVar[Mapping[str, Writer]] = {"principal.png": _principal, "edges.png": edges_of("start", "result")}

    def settings(self) -> type[Any]:
        """See the base class."""
        from ..settings.symmetric_settings import SymmetricSettings

        return SymmetricSettings

    def function(self) -> Callable[..., JobResult[SymmetricLevel]]:
        """See the base class."""
        from ..formfinding import principal_symmetric

        return principal_symmetric

    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        """A mesh with principal edges, handles, a reference, and strips to make."""
        add = parser.add_argument
        add_inputs(parser, "triangle or quad mesh, or a built-in example:NAME; quads are cut by diagonals")
        add_labels(parser)
        add_handles(parser)
        add_fixed(parser)
        add_reference(parser, "mesh of a surface to stay close to")
        add("--on", action="append", default=[], metavar="VERTEX ...", help="impose the conditions only on the "
            f"principal polylines through these vertices: {NUMBERS}, or 'near X Y Z'")  # fmt: skip
        add_levels(parser)
        add_strips(parser)
        add_repair(parser)

    def outputs(self, arguments: argparse.Namespace) -> SymmetricOutputs:
        """See the base class."""
        return SymmetricOutputs(arguments, self.pictures)

    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        """See the base class; quads are cut into triangles."""
        mesh = read_input(arguments.input, arguments)
        chosen = ChosenVertices(mesh)
        handles, fixed = read_handles(arguments, chosen), read_fixed(arguments, chosen)
        on = [vertex for words in arguments.on for vertex in chosen.of("--on", words)]
        if mesh.topology.is_quadrangular:
            with in_numbers_of(mesh, arguments.input):
                edges, vertices, notes = read_quads(arguments, chosen)
            settings = even_settings(self.options().asked(arguments), settings)
            notes += not_held(Path(arguments.output), mesh, same=False, marks=True)
            names = replace(mesh.names, faces=None, face_lines=None)  # those of quads
            mesh = replace(mesh, vertices=vertices, topology=edges.topology, attributes=None, names=names)
        else:
            edges, notes = read_principal_edges(arguments, chosen)
        options = {
            "handles": handles,
            "fixed": vertex_mask(fixed, mesh),
            "reference": read_reference(arguments),
            "on": polyline_vertices(on, mesh, edges) if on else None,
            "levels": arguments.levels,
        }
        keeps_shape = not (settings.free or handles or options["reference"])
        warnings = slide_warnings(arguments.input, mesh, edges) if keeps_shape else []
        report = {"strips": None}
        notes = [*chosen.notes, *notes]
        return Request(mesh, options, (mesh.vertices, edges), notes, warnings, settings, report=report)

    def most_steps(self, settings: Any) -> int:
        """Those of a level."""
        return int(settings.most_steps)


class SymmetricOutputs(Outputs):
    """Labels of principal edges in the mesh or beside it, and strips.

    Args:
        arguments, pictures: See the base class.
    """

    def __init__(self, arguments: argparse.Namespace, pictures: Mapping[str, Writer]) -> None:
        super().__init__(arguments, pictures)
        self._strips = StripFiles(arguments)
        self.others = self._strips.files()
        beside = end_of_marks(self.mesh)
        self.beside = {} if beside is None else {beside: _labels}

    def more(self, request: Request, result: Any) -> bool:
        """Makes the strips, so that the report can say how true they are."""
        if not self.others:
            return False
        level, made = result.levels[-1], {}
        try:
            made = self._strips.make(level.vertices, level.principal.polylines(), level.normals)
        except TorchfairError as error:
            self.others = {}
            request.missed.append(f"strips: NOT REACHED; {error}")
        request.report["strips"] = made or None
        if made:
            request.notes.append(
                f"{made['strips']} strips: planar to {made['largest_planarity']:.2g} edges, unrolled with lengths true "
                f"to {made['largest_isometry_error']:.2g}, on {made['sheets']} sheet{'s' * (made['sheets'] != 1)} of "
                f"{made['sheet_width_millimetres']:.5g} x {made['sheet_height_millimetres']:.5g} mm"
            )
        return True

    def polylines(self, result: Any) -> Sequence[Tensor]:
        """Principal edges, unless they stand in a file beside."""
        lines: list[Tensor] = [] if self.beside else result.levels[-1].principal.polylines()
        return lines


COMMAND = SymmetricCommand()
