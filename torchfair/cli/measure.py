"""``torchfair measure``: how smooth a mesh looks, in numbers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

from ..progress import phase
from .arguments import count
from .element_tables import add_tables, tables_of, write_table
from .errors import CommandError
from .inputs import add_reference, add_repair, read_input, read_reference
from .measure_tables import LABELS, format_edges, format_panels, format_quantities, unit_of
from .output_checks import refuse_taken
from .reading import said_of
from .several import Teller, add_inputs
from .tellers import JsonLines, Rows

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..measuring import EdgeMeasures, PanelMeasures, Quantity
    from ..topology import Topology

NAME = "torchfair measure"
_DESCRIPTION = (
    "Prints the energies E and E', curvature, area, lengths and angles of a polygon mesh with their units, and the "
    "edges that spoil its smoothness most; with a reference surface, how far E is from being stationary on it."
)
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


def add_parser(subparsers: Any) -> None:
    """Adds ``measure`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "measure", help="print the smoothness of a mesh", description=_DESCRIPTION, allow_abbrev=False
    )
    add_inputs(parser, "mesh file (OBJ, OFF, PLY, STL, 3DM, DXF; GLB, ... through trimesh), or a built-in example:NAME")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print one JSON object instead of tables, a line for each of "
        "several inputs")  # fmt: skip
    form.add_argument("--csv", action="store_true", help="print comma-separated values, a row for each input")
    parser.add_argument("--worst", type=count, default=10, metavar="N", help="list the N worst edges and "
        "panels (default 10)")  # fmt: skip
    add_reference(parser, "surface on which vertices may move: measure how far E is from being stationary there")
    parser.add_argument(
        "--per-vertex", action="store_true", help="with --json and --reference: lists with an entry for every vertex"
    )
    add_tables(parser, "the mesh")
    parser.add_argument("--force", action="store_true", help="replace tables that exist")
    add_repair(parser)
    parser.set_defaults(run=run, name=NAME, teller=_teller, keeps_memory=True)


def _teller(arguments: argparse.Namespace) -> Teller:
    """Several meshes in a table, in full as CSV or JSON."""
    if arguments.json:
        return JsonLines()
    return Rows(LABELS if arguments.csv else _COLUMNS, as_csv=arguments.csv)


def run(arguments: argparse.Namespace) -> int:
    """Reads, measures, prints."""
    if arguments.per_vertex and not (arguments.json and arguments.reference):
        raise CommandError("--per-vertex gives lists with --json and --reference only", NAME)
    tables = tables_of(arguments)
    refuse_taken(list(tables), force=arguments.force)
    mesh, reference = read_input(arguments.input, arguments), read_reference(arguments)
    found = _measured(mesh, reference, arguments)
    for path, table in tables.items():
        with phase(f"writing {path.name}"):
            write_table(path, table(mesh.vertices, mesh.topology, mesh.names), overwrite=arguments.force)
    if arguments.json:
        from ..io import to_json

        sys.stdout.write(to_json(_entries(mesh, found, arguments)))
        return 0
    for line in said_of(mesh):
        print(line)
    print(f"{arguments.input}\nverdict: {found.verdict}\n{format_quantities(found.quantities)}")
    for doubt in found.doubts:
        print(f"\nC is not to be trusted: {doubt}")
    if found.edges:
        print(format_edges(found.edges, mesh.names))
    if found.panels:
        print(format_panels(found.panels, mesh.names))
    print("".join(f"wrote {path}\n" for path in tables), end="")
    return 0


class Measured(NamedTuple):
    """What was measured of one mesh.

    Attributes:
        quantities: Energies and the like.
        doubts: Reasons not to trust C.
        edges: The worst ones.
        panels: The worst ones.
        verdict: All that in a sentence.
        lists: With an entry for every vertex, by name.
    """

    quantities: list[Quantity]
    doubts: list[str]
    edges: list[EdgeMeasures]
    panels: list[PanelMeasures]
    verdict: str
    lists: dict[str, Any]


def _measured(mesh: PolygonMesh, reference: tuple[Tensor, Topology] | None, arguments: argparse.Namespace) -> Measured:
    from ..geometry import ReferenceSurface
    from ..measuring import (
        count_meetings,
        curvature_doubts,
        measure_mesh,
        measure_stationarity,
        verdict,
        worst_edges,
        worst_panels,
    )

    both = mesh.vertices, mesh.topology
    with phase("measuring energies, lengths and angles"):
        quantities, lists = measure_mesh(*both), {}
    if reference is not None:
        with phase("measuring how far E is from stationary on the reference"):
            stationarity = measure_stationarity(*both, ReferenceSurface(*reference))
        quantities += stationarity.quantities()
        lists = {"per_vertex": stationarity.per_vertex()} if arguments.per_vertex else {}
    values = {quantity.key: quantity.value for quantity in quantities}
    measures = {key: value or 0.0 for key, value in values.items()}
    with phase("looking for faces that run through each other"):
        doubts = curvature_doubts({**measures, "self_intersections": count_meetings(*both)})
    most = max(arguments.worst, 1)
    with phase("looking for the worst edges and panels"):
        edges, panels = worst_edges(*both, most), worst_panels(*both, most)
    words = verdict(values, edges, panels, doubts, names=mesh.names)
    return Measured(quantities, doubts, edges[: arguments.worst], panels[: arguments.worst], words, lists)


def _entries(mesh: PolygonMesh, found: Measured, arguments: argparse.Namespace) -> dict[str, Any]:
    """For JSON."""

    def listed(rows: Sequence[EdgeMeasures] | Sequence[PanelMeasures]) -> list[dict[str, Any]]:
        return [{**asdict(row), "vertices_in_file": [int(mesh.names.vertex(v)) for v in row.vertices]} for row in rows]

    return {
        **{quantity.key: quantity.value for quantity in found.quantities},
        "verdict": found.verdict,
        "file": arguments.input,
        "repairs": list(mesh.repairs),
        "notes": list(mesh.notes),
        "units": {quantity.key: unit_of(quantity) for quantity in found.quantities},
        "worst_edges": listed(found.edges),
        "worst_panels": listed(found.panels),
        **found.lists,
        "curvature_doubts": found.doubts,
    }
