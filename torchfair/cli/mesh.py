"""``torchfair mesh``: quads or triangles along the principal directions of a surface."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._interrupts import deferred_interrupts
from .arguments import positive_count
from .edge_marks import end_of_marks
from .errors import CommandError
from .exit_codes import IN_WORDS, exit_code
from .inputs import add_repair, read_input
from .mesh_planar import made_planar
from .options import SettingOptions
from .outputs import Outputs, add_outputs, asked_for
from .parser import CommandParser
from .pictures import edges_of
from .reading import in_numbers_of, read_report
from .request import Request, Writer
from .several import add_inputs
from .summary import note_lines
from .views import view_of

if TYPE_CHECKING:
    from ..io import PolygonMesh
    from ..meshing import MeshingSettings, QuadMesh, TriangleMesh

    Made = QuadMesh | TriangleMesh

NAME = "torchfair mesh"
_DESCRIPTION = (
    "Makes a mesh of a surface whose edges follow its principal curvature lines: quads, which are then nearly planar "
    "and have the least E of all, or a half-shifted lattice of triangles, from which 'torchfair symmetric' starts. "
    "Vertices lie on a smooth surface through those given; sharp edges and corners of the boundary stay, and what of "
    "them and the boundary follows a direction becomes lines of the mesh. The topology is that of the surface, or "
    "nothing is written."
)
_SHORTEST = 0.02  # edge of a mesh, in mean edges
_SMALLEST = 0.05  # face at curves, over the mean
_ROWS = {
    "faces": "faces",
    "quads": "  quads among them",
    "angle_mean_degrees": "angle to principal directions, mean, degrees",
    "angle_95_degrees": "... 95 %",
    "planarity_mean": "planarity, mean",
    "planarity_max": "... largest",
    "normal_variation": "E",
    "total_absolute_curvature": "C of the surface, from its fits",
    "variation_over_curvature": "E over that C",
    "distance_max": "largest distance from the surface, in mean edges",
    "shortest_edge": "shortest edge, in mean edges",
    "smallest_angle_degrees": "smallest angle of a corner, degrees",
    "smallest_curve_face": "smallest face at the boundary and creases, over the mean",
    "spacing_shortest": "shortest spacing asked for",
    "spacing_longest": "longest ...",
    "range_share": "share of the surface at the ends of the range",
}
_CREASE_ROWS = {
    "crease_edges": "edges along creases",
    "crease_distance_max": "largest distance from creases, in mean edges",
}


def add_parser(subparsers: Any) -> None:
    """Adds ``mesh`` to the commands."""
    parser: CommandParser = subparsers.add_parser(
        "mesh",
        help="mesh a surface along its principal directions",
        description=_DESCRIPTION,
        epilog=IN_WORDS,
        allow_abbrev=False,
        fill=fill,
    )
    parser.set_defaults(run=run, check=check, name=NAME)


def fill(parser: CommandParser) -> None:
    """Adds the arguments."""
    add = parser.add_argument
    add_inputs(parser, "mesh file of a surface, or a built-in example:NAME")
    add_repair(parser)
    add("--quads", type=positive_count, metavar="N", help="about so many quads")
    add("--triangles", type=positive_count, metavar="N", help="about so many triangles, with principal edges")
    add("--planar", action="store_true", help="move vertices near the surface until all polygons are planar, as "
        "'torchfair fair --planar quads' does")  # fmt: skip
    add_outputs(parser)
    options().add_to(parser)


def options() -> SettingOptions[MeshingSettings]:
    """The options that are settings."""
    from ..settings.meshing_settings import MeshingSettings

    return SettingOptions(MeshingSettings, "mesh", {})


def check(arguments: argparse.Namespace) -> MeshingSettings:
    """The settings; refuses what no input can have."""
    if (arguments.quads is None) == (arguments.triangles is None):
        raise CommandError("give one of --quads N and --triangles N")
    if arguments.planar and arguments.triangles:
        raise CommandError("--planar is for --quads: triangles are planar")
    return options().settings(arguments)


def run(arguments: argparse.Namespace) -> int:
    """Checks what can be checked first, then reads, meshes, writes and prints."""
    settings = check(arguments)
    outputs = MeshOutputs(arguments, {"mesh.png": draw_singular, "edges.png": edges_of("surface", "mesh")})
    outputs.prepare()
    surface = read_input(arguments.input, arguments)
    outputs.make_folders(surface, 0)
    began = time.perf_counter()
    with in_numbers_of(surface, arguments.input):
        made = _made(surface, arguments, settings)
    not_planar: list[str] = []
    status, request = None, Request(surface, {}, view=view_of(arguments, surface))
    with deferred_interrupts() as interrupts:
        if arguments.planar:
            made, not_planar, status = made_planar(made, surface, quiet=getattr(arguments, "quiet", False))
        missed = [*not_planar, *too_small(made.report)]
        report = _report(arguments, made, settings, missed, time.perf_counter() - began) | read_report(surface)
        outputs.save(request, made, lambda: report)
        request.interrupted = interrupts.pending
    notes = [*surface.notes, *made.notes, *request.notes]
    lines = [*note_lines(surface.repairs, notes, missed), *table(made.report)]
    outputs.finish(request, made, lines, missed)
    return exit_code(status, missed, interrupted=request.interrupted)


def _made(surface: PolygonMesh, arguments: argparse.Namespace, settings: MeshingSettings) -> Any:
    from ..meshing import principal_quads, principal_triangles

    if arguments.triangles:
        return principal_triangles(surface.vertices, surface.topology, count=arguments.triangles, settings=settings)
    return principal_quads(surface.vertices, surface.topology, count=arguments.quads, settings=settings)


def too_small(report: Mapping[str, Any]) -> list[str]:
    """The promises of the shortest edge and of faces at curves where sizes are equal, as far as they are not kept."""
    from ..formfinding import Promise

    close, more = "corners of the boundary or of creases that close stay", "ask for more faces, or raise --corner-angle"
    stay = "corners of the boundary and of creases stay, and edges of triangles along rows"
    reached, smallest = report["shortest_edge"], report["smallest_curve_face"]
    promises = [Promise("shortest edge", _SHORTEST, reached, "at least", "mean edges", remedy=f"{close}: {more}")]
    if smallest is not None and "spacing_shortest" not in report:
        name = "smallest face at the boundary and creases"
        promises.append(Promise(name, _SMALLEST, smallest, "at least", "of the mean", remedy=f"{stay}: {more}"))
    return [str(promise) for promise in promises if not promise.holds]


class MeshOutputs(Outputs):
    """The mesh, with principal edges in it or beside it, report and pictures."""

    def __init__(self, arguments: argparse.Namespace, pictures: Mapping[str, Writer]) -> None:
        super().__init__(arguments, pictures)
        beside = end_of_marks(self.mesh)
        if arguments.triangles and beside is not None:
            self.beside = {beside: _labels}

    def polylines(self, result: Any) -> Any:
        """Principal edges, unless they stand in a file beside."""
        return [] if self.beside or not hasattr(result, "principal") else result.principal.polylines()


def _labels(path: Path, request: Request, result: Any, overwrite: bool) -> None:
    from ..io import save_edge_labels

    save_edge_labels(path, result.topology, result.principal.mask, overwrite=overwrite)


def draw_singular(path: Path, request: Request, result: Any, overwrite: bool) -> None:
    """Writes the picture of a principal mesh."""
    from ..viewing import picture_principal_edges, picture_principal_mesh

    if hasattr(result, "principal"):
        both = {"principal edges": (result.vertices, result.principal)}
        picture_principal_edges(path, both, view=request.view, overwrite=overwrite)
        return
    points, indices = result.singular_points, result.singular_indices
    creases = result.creases.edges
    picture_principal_mesh(
        path, result.vertices, result.topology, points, indices, creases=creases, view=request.view, overwrite=overwrite
    )


def table(report: Mapping[str, Any]) -> list[str]:
    """What was measured on a principal mesh, one line for each."""
    rows = _ROWS | _CREASE_ROWS if report["crease_edges"] else _ROWS
    width = max(map(len, rows.values()))
    lines = [f"{label:<{width}}  {_told(name, report[name]):>10}" for name, label in rows.items() if name in report]
    found = ", ".join(f"{count} of index {index}" for index, count in report["singular"].items())
    return [*lines, f"{'singular points':<{width}}  {found or 'none':>10}"]


def _told(name: str, value: float | None) -> str:
    flat = name == "variation_over_curvature" and (value is None or value != value)
    return "flat" if flat else _shown(value)


def _shown(value: float | None) -> str:
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.4g}"


def _report(
    arguments: argparse.Namespace, made: Made, settings: Any, missed: list[str], seconds: float
) -> dict[str, Any]:
    from ..settings import plain_settings

    return {
        "job": "mesh",
        "request": asked_for(arguments),
        "settings": plain_settings(settings),
        "measures": made.report,
        "singular_points": made.singular_points,
        "singular_indices": made.singular_indices,
        "notes": list(made.notes),
        "not_reached": missed,
        "seconds": seconds,
    }
