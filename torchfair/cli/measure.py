"""``torchfair measure``: how smooth a mesh looks, in numbers."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from .arguments import count
from .errors import CommandError
from .inputs import add_reference, add_repair, read_input, read_reference
from .reading import said_of
from .several import Teller, add_inputs
from .tellers import JsonLines, Rows

if TYPE_CHECKING:
    from ..measuring import EdgeMeasures, Quantity

NAME = "torchfair measure"
_DESCRIPTION = (
    "Prints the energies E and E', curvature, area, lengths and angles of a polygon mesh with their units, and the "
    "edges that spoil its smoothness most; with a reference surface, how far E is from being stationary on it."
)
_UNITS = {
    "length": "length units of the file",
    "area": "square length units of the file",
    "1 / length": "1 / length unit of the file",
}
_LABELS = {
    "vertices": "vertices",
    "isolated_vertices": "vertices without a face",
    "edges": "edges",
    "boundary_edges": "edges on the boundary",
    "faces": "faces",
    "triangles": "triangles among them",
    "quads": "quads among them",
    "degenerate_faces": "faces without area",
    "boundary_loops": "boundary loops",
    "components": "connected components",
    "euler_characteristic": "Euler characteristic",
    "normal_variation": "E   normal variation       sum l l*",
    "angle_variation": "E'  angle variation        sum l |a|",
    "total_mean_curvature": "    total mean curvature   1/2 sum l a",
    "total_absolute_curvature": "C   absolute curvature     sum |k1| + |k2|",
    "total_absolute_curvature_corrected": "C   the same, corrected    by vertex normals",
    "total_frobenius_curvature": "C2  Frobenius curvature    sum sqrt(k1^2 + k2^2)",
    "willmore_energy": "    Willmore energy        integral of (k1 + k2)^2 / 4",
    "umbrella_fairness": "    umbrella fairness",
    "polyline_fairness": "    polyline fairness",
    "area": "area",
    "mean_edge_length": "mean edge length",
    "shortest_edge_length": "shortest edge",
    "longest_edge_length": "longest edge",
    "largest_dihedral_angle_degrees": "largest |dihedral angle|",
    "smallest_corner_angle_degrees": "smallest corner angle",
    "largest_planarity": "largest planarity (diagonal distance / mean edge)",
    "largest_conical_deviation": "farthest from conical (miss / offset distance)",
    "angle_defect_sum_degrees": "sum of angle defects",
    "judged_vertices": "vertices with a complete gradient",
    "largest_tangential_gradient": "largest tangential gradient of E",
    "mean_tangential_gradient": "mean tangential gradient of E",
    "tangential_imbalance": "imbalance (sum of these / sum of l* around vertices)",
    "largest_reference_distance": "largest distance from the reference",
}
_COLUMNS = {
    "vertices": "vertices",
    "faces": "faces",
    "normal_variation": "E",
    "total_absolute_curvature": "C",
    "angle_variation": "E'",
    "area": "area",
    "mean_edge_length": "mean edge",
    "smallest_corner_angle_degrees": "smallest angle",
    "largest_dihedral_angle_degrees": "largest |a|",
    "largest_planarity": "planarity",
}
"""Of the table of several meshes."""
_NAME = 25  # columns of a label before its formula


def add_parser(subparsers: Any) -> None:
    """Adds ``measure`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "measure", help="print the smoothness of a mesh", description=_DESCRIPTION, allow_abbrev=False
    )
    add_inputs(parser, "mesh file (OBJ, OFF, PLY; STL, GLB, ... through trimesh), or example:roof")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print one JSON object instead of tables, a line for each of "
        "several inputs")  # fmt: skip
    form.add_argument("--csv", action="store_true", help="print comma-separated values, a row for each input")
    parser.add_argument("--worst", type=count, default=10, metavar="N", help="list the N worst edges (default 10)")
    add_reference(parser, "surface on which vertices may move: measure how far E is from being stationary there")
    parser.add_argument(
        "--per-vertex", action="store_true", help="with --json and --reference: lists with an entry for every vertex"
    )
    add_repair(parser)
    parser.set_defaults(run=run, name=NAME, teller=_teller)


def _teller(arguments: argparse.Namespace) -> Teller:
    """Several meshes in a table, in full as CSV or JSON."""
    if arguments.json:
        return JsonLines()
    return Rows(_LABELS if arguments.csv else _COLUMNS, as_csv=arguments.csv)


def run(arguments: argparse.Namespace) -> int:
    """Reads, measures, prints."""
    from ..geometry import ReferenceSurface
    from ..measuring import curvature_doubts, measure_mesh, measure_stationarity, worst_edges
    from ..self_intersections import self_intersections

    if arguments.per_vertex and not (arguments.json and arguments.reference):
        raise CommandError("--per-vertex gives lists with --json and --reference only", NAME)
    mesh, reference = read_input(arguments.input, arguments), read_reference(arguments)
    quantities = measure_mesh(mesh.vertices, mesh.topology)
    lists = {}
    if reference is not None:
        stationarity = measure_stationarity(mesh.vertices, mesh.topology, ReferenceSurface(*reference))
        quantities += stationarity.quantities()
        lists = {"per_vertex": stationarity.per_vertex()} if arguments.per_vertex else {}
    measures = {quantity.key: quantity.value or 0.0 for quantity in quantities}
    meetings = len(self_intersections(mesh.vertices, mesh.topology))
    doubts = curvature_doubts({**measures, "self_intersections": meetings})
    worst = worst_edges(mesh.vertices, mesh.topology, arguments.worst)
    if arguments.json:
        entries = {
            "file": arguments.input,
            "repairs": list(mesh.repairs),
            "notes": list(mesh.notes),
            "units": {quantity.key: _unit(quantity) for quantity in quantities},
            "worst_edges": worst,
            **lists,
            "curvature_doubts": doubts,
        }
        from ..io import to_json

        sys.stdout.write(to_json({**{quantity.key: quantity.value for quantity in quantities}, **entries}))
    else:
        for line in said_of(mesh):
            print(line)
        print(f"{arguments.input}\n{format_quantities(quantities)}")
        for doubt in doubts:
            print(f"\nC is not to be trusted: {doubt}")
        if worst:
            print(format_edges(worst))
    return 0


def format_quantities(quantities: list[Quantity]) -> str:
    """The quantities as lines of text under their headings; counts and pure numbers go without a unit."""
    labels = [_label(quantity) for quantity in quantities]
    width = max(map(len, labels))
    lines = []
    group = None
    for quantity, label in zip(quantities, labels, strict=True):
        if quantity.group != group:
            group = quantity.group
            lines += ["", group]
        unit = "" if quantity.unit == "dimensionless" else f"  {_unit(quantity)}"
        lines.append(f"  {label:<{width}}  {_number(quantity.value):>12}{unit}")
    return "\n".join(lines)


def format_edges(edges: list[EdgeMeasures]) -> str:
    """The edges as a table."""
    lines = [
        "",
        "worst edges (l and l |a| in length units of the file, a in degrees, positive where convex)",
        f"  {'edge':>9} {'vertices':>19} {'l':>12} {'a':>12} {'l |a|':>12}",
    ]
    for edge in edges:
        ends = f"{edge.vertices[0]} - {edge.vertices[1]}"
        numbers = (edge.length, edge.dihedral_angle_degrees, edge.angle_variation)
        lines.append(f"  {edge.edge:>9} {ends:>19} " + " ".join(f"{_number(x):>12}" for x in numbers))
    return "\n".join(lines)


def _label(quantity: Quantity) -> str:
    """What a quantity is called in the table; an energy per area by the name of the energy, without its formula."""
    if quantity.unit == "1 / length":
        return _LABELS[quantity.key.removesuffix("_per_area")][:_NAME].rstrip()
    return _LABELS[quantity.key]


def _unit(quantity: Quantity) -> str:
    return _UNITS.get(quantity.unit, quantity.unit)


def _number(value: float | int | None) -> str:
    """Six significant digits, whole counts in full, a dash where nothing is defined."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.6g}"
