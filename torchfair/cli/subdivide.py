"""``torchfair subdivide``: a finer mesh, with the marks on its edges carried along."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import degrees, positive_count
from .edge_marks import carried, end_of_marks, read_marks
from .inputs import add_repair, read_input
from .output_checks import make_folders, refuse_taken, refuse_unknown_format
from .output_names import OutputNames
from .reading import in_numbers_of, said_of
from .result_files import save_result
from .several import add_inputs

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..subdivision import Refinement

_BYTES = 200  # of a vertex and its faces as text, about

NAME = "torchfair subdivide"
_DESCRIPTION = (
    "Cuts every triangle into four triangles and every other face into quads, and moves the vertices by the rules of "
    "the scheme. Edges that are marked in INPUT (line elements of an OBJ file, or NAME.edges.json beside another) are "
    "marked in OUTPUT."
)
_SCHEMES = ("loop", "catmull-clark", "hybrid", "midpoint")


def add_parser(subparsers: Any) -> None:
    """Adds ``subdivide`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "subdivide", help="refine a mesh", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add_inputs(parser, "mesh file, or a built-in example:NAME")
    add("-o", "--output", required=True, metavar="OUTPUT", help="mesh file to write (OBJ, OFF, PLY, "
        "STL, GLB or 3DM), or a folder")  # fmt: skip
    add("--scheme", choices=_SCHEMES, default="hybrid", help="loop for triangles; catmull-clark; hybrid, which is loop "
        "on triangles and catmull-clark on other faces; or midpoint, which moves nothing (default hybrid)")  # fmt: skip
    add("--levels", type=positive_count, default=1, metavar="N", help="how often (default 1)")
    add("--boundary", choices=("curve", "interpolate", "polyline"), default="curve", help="smooth the boundary, pass "
        "through its vertices, or keep its edges straight (default curve)")  # fmt: skip
    add("--corner-angle", type=degrees, default=40.0, metavar="DEGREES", help="boundary vertices where it turns "
        "by more than this stay (default 40)")  # fmt: skip
    add("--labels", metavar="FILE", help="OBJ or JSON file that marks edges (default: INPUT if it marks any)")
    add("--lines", choices=("auto", "parallel", "along"), default="auto", help="mark parts of marked edges alone "
        "(along), or edges parallel to them inside faces too, as for principal edges (parallel); by default parallel "
        "where marks are principal edges of a triangle mesh")  # fmt: skip
    add("--force", action="store_true", help="replace files that exist")
    add_repair(parser)
    parser.set_defaults(run=run, name=NAME)


def run(arguments: argparse.Namespace) -> int:
    """Reads, refines, writes."""
    from ..boundary import boundary_corners
    from ..io import written_together
    from ..polylines import polylines_along
    from ..subdivision import refine

    names = OutputNames.of(arguments.output)
    output, end = names.output, end_of_marks(names.output)
    refuse_unknown_format(output)
    refuse_taken([output], force=arguments.force)
    mesh = read_input(arguments.input, arguments)
    marks = read_marks(mesh, arguments)
    labels = None if marks is None or end is None else names.beside(end)
    numbers = None if mesh.vertex_map is None else names.beside(".vertices.json")
    written = [path for path in (output, labels, numbers) if path is not None]
    refuse_taken(written, force=arguments.force)
    make_folders(written, _BYTES * mesh.topology.num_vertices * 4**arguments.levels)
    scheme: Any = arguments.scheme.replace("-", "_")
    corners = boundary_corners(mesh.vertices, mesh.topology, math.radians(arguments.corner_angle))
    with in_numbers_of(mesh, arguments.input):
        step = refine(mesh.topology, scheme, arguments.levels, boundary=arguments.boundary, corners=corners)
    fine, notes = None, said_of(mesh)
    if marks is not None:
        fine, note = carried(arguments.lines, marks, step)
        notes.append(note)
    lines = [] if fine is None or labels is not None else polylines_along(step.topology, fine)
    with written_together():
        left_out = save_result(output, step.apply(mesh.vertices), step.topology, mesh, force=arguments.force,
            polylines=lines, marks=marks is not None)  # fmt: skip
        _write_beside(labels, fine, numbers, mesh, step, force=arguments.force)
    notes += [f"note: {note}" for note in left_out]
    counts = [f"{t.num_vertices} vertices, {t.num_faces} faces" for t in (mesh.topology, step.topology)]
    print("\n".join([*notes, f"{counts[0]} to {counts[1]}", *(f"wrote {path}" for path in written)]))
    return 0


def _write_beside(
    labels: Path | None, fine: Tensor | None, numbers: Path | None, mesh: PolygonMesh, step: Refinement, *, force: bool
) -> None:
    """Writes marks that the mesh does not hold, and where vertices of the file have gone."""
    from ..io import atomic_write_text, save_edge_labels, to_json

    if labels is not None and fine is not None:
        save_edge_labels(labels, step.topology, fine, overwrite=force)
    if numbers is not None:
        atomic_write_text(numbers, to_json({"vertex_map": mesh.vertex_map}), overwrite=force)
