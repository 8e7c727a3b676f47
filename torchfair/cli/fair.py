"""``torchfair fair``: slides vertices along a mesh until it looks smoother."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from .chosen_vertices import ChosenVertices, faces_of_file
from .edge_marks import MarkedOutputs, read_marks
from .errors import CommandError
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
from .pictures import draw_before_after, edges_of
from .request import Request, Writer
from .several import add_inputs

if TYPE_CHECKING:
    from ..formfinding import JobResult, Level
    from ..io import PolygonMesh


def _gauss_images(path: Path, request: Request, result: JobResult[Level], overwrite: bool) -> None:
    from ..viewing import picture_gauss_images

    both = request.mesh.topology, result.topology
    picture_gauss_images(path, request.mesh.vertices, result.vertices, both, overwrite=overwrite)


_PLANAR = "settings.planar"  # faces that the option names are counted as in the file, those of settings files from 0


class FairCommand(JobCommand):
    """Lowers E near a reference surface."""

    job = "fair"
    purpose = "make a mesh look smoother"
    description = (
        "Lowers the normal variation E of a polygon mesh by sliding its vertices along the surface, and writes the "
        "mesh, a report and pictures of before and after. Lengths are in mean edge lengths of the input."
    )
    option_names: ClassVar[Mapping[str, str]] = {"distance_limit": "distance"}
    pictures: ClassVar[Mapping[str, Writer]] = {
        "before_after.png": draw_before_after,
        "edges.png": edges_of("before", "after"),
        "gauss_images.png": _gauss_images,
    }

    def settings(self) -> type[Any]:
        """See the base class."""
        from ..settings.fair_settings import FairSettings

        return FairSettings

    def function(self) -> Callable[..., JobResult[Level]]:
        """See the base class."""
        from ..formfinding import minimise_normal_variation

        return minimise_normal_variation

    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        """A mesh, a surface to stay close to, handles, and vertices that stay."""
        add_inputs(parser, "mesh file, or a built-in example:NAME")
        add_reference(parser, "stay close to this surface instead of the input")
        add_levels(parser)
        add_handles(parser)
        add_fixed(parser)
        add_repair(parser)

    def outputs(self, arguments: argparse.Namespace) -> MarkedOutputs:
        """See the base class."""
        return MarkedOutputs(arguments, self.pictures)

    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        """See the base class."""
        mesh = read_input(arguments.input, arguments)
        _refuse_soup(mesh, arguments)
        chosen = ChosenVertices(mesh)
        if _PLANAR in arguments and not isinstance(settings.planar, str):
            settings = replace(settings, planar=faces_of_file("--planar", settings.planar, mesh))
        options = {
            "reference": read_reference(arguments),
            "handles": read_handles(arguments, chosen),
            "levels": arguments.levels,
            "fixed": read_fixed(arguments, chosen),
        }
        return Request(mesh, options, notes=chosen.notes, marks=read_marks(mesh, arguments), settings=settings)


def _refuse_soup(mesh: PolygonMesh, arguments: argparse.Namespace) -> None:
    """Refuses meshes of several faces of which no two share an edge: E of these is 0 whatever they look like."""
    if mesh.topology.num_faces > 1 and not mesh.topology.num_interior_edges:
        welded = arguments.weld is not False
        remedy = "try --weld TOLERANCE with a larger one" if welded else "--weld joins edges at the same place"
        raise CommandError(f"no two faces of {arguments.input} share an edge, so that E is 0 whatever it is: {remedy}")


COMMAND = FairCommand()
