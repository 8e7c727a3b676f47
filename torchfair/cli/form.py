"""``torchfair form``: finds the surface of least total absolute curvature with a given boundary."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import count, non_negative, positive_count, turning_angle, vertex_target, with_settings
from .form_inputs import FormInput, read_form_input
from .form_outputs import PICTURES, FormOutputs

if TYPE_CHECKING:
    from ..formfinding import FormResult, FormSettings

NAME = "torchfair form"
_DESCRIPTION = (
    "Finds the surface of least total absolute curvature C, the integral of |k1| + |k2|, with a given boundary: the "
    "smoothest that a polyhedral mesh can approximate. Starts from a mesh, or from one or two boundary curves alone."
)


def add_parser(subparsers: Any) -> None:
    """Adds ``form`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "form", help="find a surface of least absolute curvature", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add("input", metavar="INPUT", nargs="?", help="mesh file to start from, or a built-in example:NAME; left out, a "
        "start is made from the curves")  # fmt: skip
    add("-o", "--output", required=True, metavar="OUTPUT", help="mesh file to write (OBJ, OFF or PLY)")
    add("--curve", action="append", default=[], metavar="FILE", help="closed boundary curve: a text file with x y z, "
        "or x y z and a normal, in every line; one for a disk, two for an annulus")  # fmt: skip
    add("--vertices", type=positive_count, default=1000, metavar="N", help="size of a start made from curves "
        "(default 1000)")  # fmt: skip
    add("--levels", type=count, default=0, metavar="N", help="refine the result and improve it, so many times "
        "(default 0)")  # fmt: skip
    add("--results", metavar="FOLDER", help="folder of report.json and pictures (default: that of OUTPUT)")
    add("--no-pictures", action="store_true", help="write no pictures")
    add("--force", action="store_true", help="replace files that exist")
    add("--repair", action="store_true", help="orient faces consistently and drop unused vertices first")
    add("--boundary", choices=("fixed", "glide"), default="fixed", help="boundary vertices stay, or slide along the "
        "boundary curves (default fixed)")  # fmt: skip
    add("--corner-angle", type=turning_angle, default="40", metavar="DEG", help="a boundary curve has a corner where "
        "it turns by more than this (default 40)")  # fmt: skip
    add("--handle", nargs=4, action="append", default=[], metavar=("VERTEX", "X", "Y", "Z"),
        help="pull a vertex of INPUT (counted from 0) to a place; repeatable")  # fmt: skip
    add("--through", nargs=3, action="append", default=[], type=float, metavar=("X", "Y", "Z"),
        help="a point to pass through: pulls the nearest inner vertex of the start; repeatable")  # fmt: skip
    for name, default in (("fairness", 1.0), ("tangential-fairness", 0.0)):
        add(f"--{name}", type=non_negative, default=default, metavar="W", help=f"weight of {name.replace('-', ' ')} "
            f"(default {default:g})")  # fmt: skip
    add("--smoothing", type=non_negative, default=0.05, metavar="S", help="curvature below this fraction of the mean "
        "counts as flat in the end (default 0.05)")  # fmt: skip
    add("--formulation", choices=("reduced", "lifted"), default="reduced",
        help="unknowns: vertices only, or the paper's auxiliary variables too (default reduced)")  # fmt: skip
    add("--solver", choices=("auto", "dense", "scipy", "rslab", "cg"), default="auto", help="linear solver")
    add("--iterations", type=positive_count, default=20, metavar="N", help="at most this many steps in each stage "
        "(default 20)")  # fmt: skip
    parser.set_defaults(run=run, name=NAME)


def run(arguments: argparse.Namespace) -> int:
    """Checks everything that can be checked first, then solves, then writes."""
    outputs = FormOutputs(Path(arguments.output), arguments.results, () if arguments.no_pictures else PICTURES)
    outputs.check(force=arguments.force)
    settings = read_settings(arguments)
    start = read_form_input(arguments, settings.corner_angle)
    handles = dict(vertex_target(*words) for words in arguments.handle) | start.nearest(arguments.through)
    outputs.make_folders()
    result = solve(start, handles, settings, arguments.levels)
    for sentence in (*start.mesh.repairs, *result.notes):
        print(f"note: {sentence}")
    outputs.write(start.mesh, result, settings, arguments)
    print(summary(result))
    print("\n".join(f"wrote {path}" for path in outputs.paths()))
    return 0


def solve(start: FormInput, handles: dict[int, list[float]], settings: FormSettings, levels: int) -> FormResult:
    """Runs the job with a progress display."""
    from ..formfinding import minimise_absolute_curvature
    from ..progress import ProgressDisplay

    with ProgressDisplay(settings.projection.max_iterations) as display:
        return minimise_absolute_curvature(
            start.mesh.vertices,
            start.mesh.topology,
            curves=start.curves or None,
            normals=start.normals,
            handles=handles,
            levels=levels,
            settings=settings,
            callback=display,
        )


def read_settings(arguments: argparse.Namespace) -> FormSettings:
    """Settings of the job from the command line."""
    from ..formfinding import FormSettings

    defaults = FormSettings()
    projection = with_settings(defaults.projection, max_iterations=arguments.iterations, solver=arguments.solver)
    return with_settings(
        defaults,
        fairness_weight=arguments.fairness,
        tangential_fairness_weight=arguments.tangential_fairness,
        boundary=arguments.boundary,
        corner_angle=arguments.corner_angle,
        smoothing=arguments.smoothing,
        coarse_smoothing=max(defaults.coarse_smoothing, arguments.smoothing),
        formulation=arguments.formulation,
        projection=projection,
    )


def summary(result: FormResult) -> str:
    """What changed, in a few lines."""
    before, after = result.before, result.after
    lines = [
        f"C {before['total_absolute_curvature']:.6g} -> {after['total_absolute_curvature']:.6g}",
        f"E {before['normal_variation']:.6g} -> {after['normal_variation']:.6g}",
        f"area {before['area']:.6g} -> {after['area']:.6g}",
        f"smallest angle {before['smallest_angle_degrees']:.1f} -> {after['smallest_angle_degrees']:.1f} degrees",
    ]
    if before["largest_tilt_degrees"]:
        lines.append(f"largest angle to a prescribed tangent plane {after['largest_tilt_degrees']:.2g} degrees")
    if before["largest_handle_distance"]:
        lines.append(f"largest distance of a handle from its target {after['largest_handle_distance']:.3g}")
    steps = sum(run.iterations for run in result.stages)
    seconds = sum(run.timings["total"] for run in result.stages)
    return "\n".join([*lines, f"{steps} steps in {len(result.stages)} stages, {seconds:.2f} s: {result.message}"])
