"""``torchfair form``: finds the surface of least total absolute curvature with a given boundary."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from .arguments import finite, positive_count
from .chosen_vertices import ChosenVertices
from .form_inputs import read_form_input
from .form_mesh import FormOutputs, add_mesh
from .inputs import add_fixed, add_handles, add_levels, add_repair, read_fixed, read_handles
from .job_command import JobCommand
from .pictures import edges_of
from .request import Request, Writer
from .several import add_inputs

if TYPE_CHECKING:
    from ..formfinding import JobResult, Level


def _curvature(path: Path, request: Request, result: JobResult[Level], overwrite: bool) -> None:
    from ..viewing import picture_curvature

    start = ("start", request.mesh.vertices, request.mesh.topology)
    picture_curvature(
        path, [start, ("result", result.vertices, result.topology)], view=request.view, overwrite=overwrite
    )


_STARTS = 6  # surfaces that are tried where nobody said where to start


class FormCommand(JobCommand):
    """Lowers C with a given boundary."""

    job = "form"
    purpose = "find a surface of least absolute curvature"
    description = (
        "Finds the surface of least total absolute curvature C, the integral of |k1| + |k2|, with a given boundary: "
        "the smoothest that a polyhedral mesh can approximate. Starts from a mesh, or from boundary curves "
        "alone, of which several surfaces are tried."
    )
    pictures: ClassVar[Mapping[str, Writer]] = {"curvature.png": _curvature, "edges.png": edges_of("start", "result")}

    def settings(self) -> type[Any]:
        """See the base class."""
        from ..settings.form_settings import FormSettings

        return FormSettings

    def function(self) -> Callable[..., JobResult[Level]]:
        """See the base class."""
        from ..formfinding import minimise_absolute_curvature

        return minimise_absolute_curvature

    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        """A mesh or curves, and points to pass through."""
        add = parser.add_argument
        words = "mesh file to start from, or a built-in example:NAME; left out, a start is made from the curves"
        add_inputs(parser, words, needed=False)
        add("--curve", action="append", default=[], metavar="FILE", help="closed boundary curve: a text file with x y "
            "z, or x y z and a normal, in every line; or the curves of an OBJ (line elements), DXF or 3DM file; one "
            "curve for a disk, two for an annulus, more for more holes; repeatable")  # fmt: skip
        add("--close", action="store_true", help="close open arcs by straight lines")
        add("--starts", type=positive_count, metavar="N", help="try so many surfaces to start from, and go on with the "
            f"best (default {_STARTS} from curves alone, 1 from a mesh)")  # fmt: skip
        add("--remesh", action="store_true", help="replace the triangles where they become thin or fold, and go on: "
            "vertices have other numbers then; always done without a mesh to start from")  # fmt: skip
        add("--vertices", type=positive_count, default=1000, metavar="N", help="size of a start made from curves "
            "(default 1000)")  # fmt: skip
        add("--through", nargs=3, action="append", default=[], type=finite, metavar=("X", "Y", "Z"),
            help="a point to pass through: pulls the nearest inner vertex of the start; repeatable")  # fmt: skip
        add_levels(parser)
        add_mesh(parser)
        add_handles(parser)
        add_fixed(parser)
        add_repair(parser)

    def outputs(self, arguments: argparse.Namespace) -> FormOutputs:
        """See the base class."""
        return FormOutputs(arguments, self.pictures)

    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        """See the base class."""
        start = read_form_input(arguments, settings.corner_angle)
        chosen = ChosenVertices(start.mesh, start.notes)
        fixed, alone = read_fixed(arguments, chosen), arguments.input is None
        options = {
            "curves": start.curves or None,
            "normals": start.normals,
            "handles": read_handles(arguments, chosen) | start.nearest(arguments.through),
            "fixed": fixed,
            "levels": arguments.levels,
            "remesh": arguments.remesh or alone,
            "starts": arguments.starts or (_STARTS if alone and not fixed else 1),
        }
        return Request(start.mesh, options, notes=start.notes)


COMMAND = FormCommand()
