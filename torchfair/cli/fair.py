"""``torchfair fair``: slides vertices along a mesh until it looks smoother."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import non_negative, positive_count, positive_or_none, turning_angle, vertex_target, with_settings
from .fair_outputs import PICTURES, FairOutputs
from .inputs import read_input

if TYPE_CHECKING:
    from ..formfinding import FairSettings, JobResult, Level
    from ..io import PolygonMesh

NAME = "torchfair fair"
_DESCRIPTION = (
    "Lowers the normal variation E of a polygon mesh by sliding its vertices along the surface, and writes the mesh, "
    "report.json and pictures of before and after. Lengths are in mean edge lengths of the input."
)


def add_parser(subparsers: Any) -> None:
    """Adds ``fair`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "fair", help="make a mesh look smoother", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add("input", metavar="INPUT", help="mesh file, or example:roof or example:hybrid_roof")
    add("-o", "--output", required=True, metavar="OUTPUT", help="mesh file to write (OBJ, OFF or PLY)")
    add("--results", metavar="FOLDER", help="folder of report.json and pictures (default: that of OUTPUT)")
    add("--no-pictures", action="store_true", help="write no pictures")
    add("--force", action="store_true", help="replace files that exist")
    add("--repair", action="store_true", help="orient faces consistently and drop unused vertices first")
    add("--reference", metavar="FILE", help="stay close to this surface instead of the input")
    add("--distance", type=positive_or_none, default=0.05, metavar="D", help="no vertex goes farther from the "
        "reference than this many mean edges; 'none' for no limit (default 0.05)")  # fmt: skip
    add("--boundary", choices=("glide", "fixed", "free"), default="glide", help="boundary vertices slide along the "
        "boundary curve, stay, or are free (default glide)")  # fmt: skip
    add("--corner-angle", type=turning_angle, default="40", metavar="DEG", help="the boundary curve has a corner, "
        "which stays, where it turns by more than this (default 40)")  # fmt: skip
    add("--handle", nargs=4, action="append", default=[], metavar=("VERTEX", "X", "Y", "Z"),
        help="pull a vertex (counted from 0) to a place; repeatable")  # fmt: skip
    add("--planar", choices=("keep", "quads", "none"), default="keep", help="keep planar polygons planar, make all "
        "polygons planar, or neither (default keep)")  # fmt: skip
    add("--smallest-angle", type=non_negative, default=10.0, metavar="DEG", help="no corner angle falls below this, "
        "or below the smallest of the input (default 10)")  # fmt: skip
    for name, default in (("energy", 1.0), ("closeness", 100.0), ("fairness", 0.3)):
        add(
            f"--{name}", type=non_negative, default=default, metavar="W", help=f"weight of {name} (default {default:g})"
        )
    add("--formulation", choices=("reduced", "lifted"), default="reduced",
        help="unknowns: vertices only, or the paper's auxiliary variables too (default reduced)")  # fmt: skip
    add("--solver", choices=("auto", "dense", "scipy", "rslab", "cg"), default="auto", help="linear solver")
    add("--iterations", type=positive_count, default=80, metavar="N", help="at most this many steps (default 80)")
    parser.set_defaults(run=run, name=NAME)


def run(arguments: argparse.Namespace) -> int:
    """Checks everything that can be checked first, then solves, then writes."""
    outputs = FairOutputs(Path(arguments.output), arguments.results, () if arguments.no_pictures else PICTURES)
    outputs.check(force=arguments.force)
    mesh = read_input(arguments.input, arguments.repair)
    reference = read_input(arguments.reference, arguments.repair) if arguments.reference else None
    outputs.make_folders()
    result, settings = solve(mesh, reference, arguments)
    for sentence in mesh.repairs:
        print(f"repaired: {sentence}")
    for note in result.notes:
        print(f"note: {note}")
    outputs.write(mesh, result, settings, arguments)
    print(summary(result))
    print("\n".join(f"wrote {path}" for path in outputs.paths()))
    return 0


def solve(
    mesh: PolygonMesh, reference: PolygonMesh | None, arguments: argparse.Namespace
) -> tuple[JobResult[Level], FairSettings]:
    """Runs the job with a progress display."""
    from ..formfinding import minimise_normal_variation
    from ..progress import ProgressDisplay

    settings = read_settings(arguments)
    handles = dict(vertex_target(*words) for words in arguments.handle)
    with ProgressDisplay(settings.projection.max_iterations) as display:
        result = minimise_normal_variation(
            mesh.vertices,
            mesh.topology,
            reference=None if reference is None else (reference.vertices, reference.topology),
            handles=handles,
            settings=settings,
            callback=display,
        )
    return result, settings


def read_settings(arguments: argparse.Namespace) -> FairSettings:
    """Settings of the job from the command line."""
    from ..formfinding import FairSettings

    defaults = FairSettings()
    projection = with_settings(defaults.projection, max_iterations=arguments.iterations, solver=arguments.solver)
    return with_settings(
        defaults,
        energy_weight=arguments.energy,
        closeness_weight=arguments.closeness,
        distance_limit=arguments.distance,
        fairness_weight=arguments.fairness,
        boundary=arguments.boundary,
        corner_angle=arguments.corner_angle,
        planar=arguments.planar,
        smallest_angle=math.radians(arguments.smallest_angle),
        formulation=arguments.formulation,
        projection=projection,
    )


def summary(result: JobResult[Level]) -> str:
    """What changed, in a few lines."""
    before, after = result.before, result.after
    change = (
        100.0 * (after["normal_variation"] / before["normal_variation"] - 1.0) if before["normal_variation"] else 0.0
    )
    lines = [
        f"E  {before['normal_variation']:.6g} -> {after['normal_variation']:.6g} ({change:+.1f} %)",
        f"E' {before['angle_variation']:.6g} -> {after['angle_variation']:.6g}",
        f"largest distance from the reference {after['largest_distance']:.3g} "
        f"({100 * after['largest_distance_relative']:.2f} % of a mean edge)",
        f"smallest angle {before['smallest_angle_degrees']:.1f} -> {after['smallest_angle_degrees']:.1f} degrees, "
        f"smallest face area {100 * after['smallest_area_ratio']:.0f} % of its own, "
        f"{after['flipped_faces']} faces flipped",
    ]
    if after["largest_planarity"] or before["largest_planarity"]:
        lines.append(
            f"largest planarity of kept faces {before['largest_planarity']:.1e} -> {after['largest_planarity']:.1e}"
        )
    if after["largest_handle_distance"] or before["largest_handle_distance"]:
        lines.append(f"largest distance of a handle from its target {after['largest_handle_distance']:.3g}")
    run = result.projection
    return "\n".join([*lines, f"{run.iterations} steps, {run.timings['total']:.2f} s: {run.message}"])
