"""``torchfair symmetric``: makes a triangle mesh principal-symmetric, refines it, and unrolls strips along it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from .arguments import count, non_negative, positive_count, vertex_target, with_settings
from .inputs import read_input
from .symmetric_inputs import polyline_vertices, read_principal_edges, vertex_mask
from .symmetric_outputs import PICTURES, SymmetricOutputs

if TYPE_CHECKING:
    from ..formfinding import SymmetricResult, SymmetricSettings
    from ..io import PolygonMesh
    from ..principal import PrincipalEdges

NAME = "torchfair symmetric"
_DESCRIPTION = (
    "Makes a triangle mesh principal-symmetric: one third of its edges follow principal curvature lines and the others "
    "lie symmetrically to them, which represents saddles best. Pulls vertices, refines the mesh, and writes "
    "developable strips along the principal edges."
)


def add_parser(subparsers: Any) -> None:
    """Adds ``symmetric`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "symmetric", help="design a principal-symmetric mesh", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add("input", metavar="INPUT", help="triangle mesh, or a built-in example:NAME")
    add("-o", "--output", required=True, metavar="OUTPUT", help="mesh file to write; in an OBJ file principal edges "
        "are line elements, beside others stands NAME.edges.json")  # fmt: skip
    labels = parser.add_mutually_exclusive_group()
    labels.add_argument("--labels", metavar="FILE", help="OBJ or JSON file that marks the principal edges (default: "
        "INPUT if it marks any, else those along principal directions)")  # fmt: skip
    labels.add_argument("--seed", nargs=2, type=count, metavar=("V", "W"), help="an edge, by its vertices (counted "
        "from 0), that is principal; the others follow straight on and in parallel")  # fmt: skip
    add("--allow-exceptions", action="store_true", help="leave out vertices where principal edges do not fit together")
    add("--results", metavar="FOLDER", help="folder of report.json, pictures and strips (default: that of OUTPUT)")
    add("--no-pictures", action="store_true", help="write no pictures")
    add("--force", action="store_true", help="replace files that exist")
    add("--handle", nargs=4, action="append", default=[], metavar=("VERTEX", "X", "Y", "Z"),
        help="pull a vertex (counted from 0) to a place; repeatable")  # fmt: skip
    add("--fix", nargs="+", type=count, default=[], metavar="VERTEX", help="vertices that keep their places")
    add("--boundary", choices=("free", "fixed"), default="free", help="whether boundary vertices keep their places "
        "(default free)")  # fmt: skip
    add("--reference", metavar="FILE", help="mesh of a surface to stay close to")
    add("--on", nargs="+", type=count, default=[], metavar="VERTEX", help="impose the conditions only on the principal "
        "polylines through these vertices")  # fmt: skip
    add("--levels", type=count, default=0, metavar="N", help="refine and optimise again, so many times (default 0)")
    add("--energy", type=non_negative, default=0.0, metavar="W", help="weight of E beside the conditions (default 0)")
    add("--fairness", type=non_negative, default=1.0, metavar="W", help="weight of fairness (default 1)")
    add("--evenness", type=non_negative, default=0.0, metavar="W", help="weight of symmetric stars; 3 for quads cut by "
        "diagonals, which start sheared (default 0)")  # fmt: skip
    add("--closeness", type=non_negative, default=1.0, metavar="W", help="weight of closeness to --reference "
        "(default 1)")  # fmt: skip
    add("--strips", type=non_negative, metavar="HEIGHT", help="write strips of this height orthogonal to the mesh "
        "along the principal edges: strips.obj in space with uv, strips.svg flat")  # fmt: skip
    add("--depth", type=non_negative, default=0.0, metavar="DEPTH", help="how far strips reach to the other side "
        "(default 0)")  # fmt: skip
    add("--millimetres", type=non_negative, default=1.0, metavar="MM", help="length of one unit of INPUT in flat "
        "drawings (default 1)")  # fmt: skip
    add("--dxf", action="store_true", help="write strips.dxf too (needs the extra torchfair[dxf])")
    add("--formulation", choices=("spheres", "eliminated", "lifted"), default="spheres", help="unknowns beside the "
        "vertices: spheres of stars, none, or the paper's (default spheres)")  # fmt: skip
    add("--solver", choices=("auto", "dense", "scipy", "rslab", "cg"), default="auto", help="linear solver")
    add("--steps", type=positive_count, default=300, metavar="N", help="at most this many steps on each level "
        "(default 300)")  # fmt: skip
    parser.set_defaults(run=run, name=NAME)


def run(arguments: argparse.Namespace) -> int:
    """Checks everything that can be checked first, then solves, then writes."""
    outputs = SymmetricOutputs(arguments, () if arguments.no_pictures else PICTURES)
    outputs.check(force=arguments.force)
    settings = read_settings(arguments)
    handles = dict(vertex_target(*words) for words in arguments.handle)
    mesh = read_input(arguments.input, repair=False)
    edges, notes = read_principal_edges(arguments, mesh)
    reference = None if arguments.reference is None else read_input(arguments.reference, repair=False)
    outputs.make_folders()
    result = solve(mesh, edges, handles, reference, settings, arguments)
    for sentence in (*notes, *result.notes):
        print(f"note: {sentence}")
    notes_of_strips = outputs.write(mesh, edges, result, settings, arguments, notes)
    print(summary(result))
    print("\n".join([*notes_of_strips, *(f"wrote {path}" for path in outputs.paths())]))
    return 0


def solve(
    mesh: PolygonMesh,
    edges: PrincipalEdges,
    handles: dict[int, list[float]],
    reference: PolygonMesh | None,
    settings: SymmetricSettings,
    arguments: argparse.Namespace,
) -> SymmetricResult:
    """Runs the job with a progress display."""
    from ..formfinding import principal_symmetric
    from ..progress import ProgressDisplay

    fixed = vertex_mask("--fix", arguments.fix, mesh)
    on = polyline_vertices(arguments.on, mesh, edges) if arguments.on else None
    with ProgressDisplay(settings.most_steps) as display:
        return principal_symmetric(
            mesh.vertices,
            edges,
            handles=handles,
            fixed=fixed,
            reference=None if reference is None else (reference.vertices, reference.topology),
            on=on,
            levels=arguments.levels,
            settings=settings,
            callback=display,
        )


def read_settings(arguments: argparse.Namespace) -> SymmetricSettings:
    """Settings of the job from the command line."""
    from ..formfinding import SymmetricSettings

    defaults = SymmetricSettings()
    return with_settings(
        defaults,
        boundary=arguments.boundary,
        energy_weight=arguments.energy,
        fairness_weight=arguments.fairness,
        evenness_weight=arguments.evenness,
        closeness_weight=arguments.closeness,
        formulation=arguments.formulation,
        most_steps=arguments.steps,
        projection=with_settings(defaults.projection, solver=arguments.solver),
    )


def summary(result: SymmetricResult) -> str:
    """What came out, one line for each level."""
    lines = []
    for number, level in enumerate(result.levels):
        after = level.after
        lines.append(
            f"level {number}: {level.vertices.shape[0]} vertices, largest relative residual "
            f"{max(after['largest_cospherical'], after['largest_coplanar']):.2g}, saddle sides right at "
            f"{100 * after['saddle_side_share']:.4g} % of {after['negative_stars']:.0f}, "
            f"{after['crossing_pyramids_negative']:.0f} of them with a crossing pyramid, "
            f"E/C {after['energy_over_curvature']:.4g}; {level.steps} steps in "
            f"{sum(run.timings['total'] for run in level.runs):.2f} s"
        )
    return "\n".join(lines)
