"""``torchfair subdivide``: a finer mesh, with the marks on its edges carried along."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import non_negative, positive_count
from .edge_marks import carried, file_of_marks, read_marks
from .inputs import add_repair, read_input
from .outputs import refuse_existing, refuse_unknown_format, save_result
from .reading import in_numbers_of, said_of

if TYPE_CHECKING:
    pass

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
    add("input", metavar="INPUT", help="mesh file, or a built-in example:NAME")
    add("-o", "--output", required=True, metavar="OUTPUT", help="mesh file to write (OBJ, OFF or PLY)")
    add("--scheme", choices=_SCHEMES, default="hybrid", help="loop for triangles; catmull-clark; hybrid, which is loop "
        "on triangles and catmull-clark on other faces; or midpoint, which moves nothing (default hybrid)")  # fmt: skip
    add("--levels", type=positive_count, default=1, metavar="N", help="how often (default 1)")
    add("--boundary", choices=("curve", "interpolate", "polyline"), default="curve", help="smooth the boundary, pass "
        "through its vertices, or keep its edges straight (default curve)")  # fmt: skip
    add("--corner-angle", type=non_negative, default=40.0, metavar="DEGREES", help="boundary vertices where it turns "
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
    from ..polylines import polylines_along
    from ..subdivision import refine

    output = Path(arguments.output)
    refuse_unknown_format(output)
    beside = file_of_marks(output)
    refuse_existing([output], force=arguments.force)
    mesh = read_input(arguments.input, arguments)
    marks = read_marks(mesh, arguments)
    if marks is not None and beside is not None:
        refuse_existing([beside], force=arguments.force)
    numbers = output.with_suffix(".vertices.json")
    if mesh.vertex_map is not None:
        refuse_existing([numbers], force=arguments.force)
    scheme: Any = arguments.scheme.replace("-", "_")
    corners = boundary_corners(mesh.vertices, mesh.topology, math.radians(arguments.corner_angle))
    with in_numbers_of(mesh):
        step = refine(mesh.topology, scheme, arguments.levels, boundary=arguments.boundary, corners=corners)
    lines, notes = [], said_of(mesh)
    written = [output]
    output.parent.mkdir(parents=True, exist_ok=True)
    fine = None
    if marks is not None:
        fine, note = carried(arguments.lines, marks, step)
        notes.append(note)
        lines = polylines_along(step.topology, fine) if beside is None else []
    vertices = step.apply(mesh.vertices)
    left_out = save_result(output, vertices, step.topology, mesh, force=arguments.force, polylines=lines,
        marks=marks is not None)  # fmt: skip
    notes += [f"note: {note}" for note in left_out]
    if fine is not None and beside is not None:
        from ..io import save_edge_labels

        save_edge_labels(beside, step.topology, fine, overwrite=arguments.force)
        written.append(beside)
    if mesh.vertex_map is not None:
        from ..io import atomic_write_text, to_json

        atomic_write_text(numbers, to_json({"vertex_map": mesh.vertex_map}), overwrite=arguments.force)
        written.append(numbers)
    counts = [f"{t.num_vertices} vertices, {t.num_faces} faces" for t in (mesh.topology, step.topology)]
    print("\n".join([*notes, f"{counts[0]} to {counts[1]}", *(f"wrote {path}" for path in written)]))
    return 0
