"""What a job says on the console: measures before and after, and what was promised."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .._names import FROM_ZERO, Names

if TYPE_CHECKING:
    from ..formfinding import JobResult

LABELS = {
    "normal_variation": "E",
    "total_absolute_curvature": "C (normal cycle, E is never below)",
    "energy_over_curvature": "E/C",
    "angle_variation": "E'",
    "area": "area",
    "largest_face_area": "largest face area",
    "longest_edge": "longest edge",
    "shortest_edge": "shortest edge",
    "smallest_edge_ratio": "shortest side of a polygon over its own at the start",
    "smallest_angle_degrees": "smallest angle, degrees",
    "smallest_area_ratio": "smallest face area over its own at the start",
    "largest_area_ratio": "largest face area over its own at the start",
    "largest_growth": "... or over half the mean, if that is more",
    "flipped_faces": "faces flipped",
    "largest_distance": "largest distance from the reference",
    "largest_distance_relative": "... in mean edges",
    "largest_distance_back": "largest distance back, from the reference",
    "largest_distance_back_relative": "... in mean edges",
    "largest_boundary_distance": "largest distance from boundary curves",
    "largest_planarity": "largest planarity of kept polygons",
    "largest_planarity_of_all": "largest planarity of all polygons",
    "largest_planarity_growth": "... growth of that of nearly planar ones",
    "largest_fold_degrees": "largest fold of edges kept flat, degrees",
    "largest_tilt_degrees": "largest angle to a prescribed tangent plane, degrees",
    "largest_cospherical": "largest residual of spheres, relative",
    "largest_coplanar": "largest residual of normals, relative",
    "largest_displacement": "largest displacement of a vertex",
    "mean_displacement": "... mean",
    "largest_distance_from_start": "largest distance from where the surface was, mean edges",
    "changed_stars": "stars of another kind than at the start",
    "convex_stars": "convex stars",
    "good_saddles": "good saddles",
    "bad_saddles": "bad saddles",
    "neither_stars": "stars that are neither",
    "crossing_pyramids": "crossing pyramids",
    "negative_stars": "stars with an angle sum above 360 degrees",
    "saddle_side_share": "... with their sides right",
    "crossing_pyramids_negative": "... with a crossing pyramid",
    "largest_handle_distance": "largest distance of a handle from its target",
}
"""Measures in the order of the console; others follow by their names."""

_ONLY_IN_REPORTS = {
    *("total_mean_curvature", "total_frobenius_curvature", "mean_edge_length", "mean_cospherical", "mean_coplanar"),
    "stars",
}
_IF_ANY = {name for name in LABELS if name.startswith("largest_")} - {"largest_area_ratio", "largest_distance"}
_IN_PERCENT = (
    "normal_variation",
    "total_absolute_curvature",
    "angle_variation",
    "area",
    "largest_face_area",
    "longest_edge",
)


def measures_table(before: Mapping[str, float], after: Mapping[str, float]) -> list[str]:
    """One line for every measure of both, with a heading; what is zero twice and was no aim is left out."""
    names = [name for name in LABELS if name in after]
    names += [name for name in after if name not in LABELS and name not in _ONLY_IN_REPORTS]
    names = [name for name in names if name in before and not (name in _IF_ANY and before[name] == after[name] == 0.0)]
    labels = [LABELS.get(name, name.replace("_", " ")) for name in names]
    width = max((len(label) for label in labels), default=0)
    lines = [f"{'':<{width}}  {'before':>10}  {'after':>10}"]
    for name, label in zip(names, labels, strict=True):
        change = _percent(before[name], after[name]) if name in _IN_PERCENT else ""
        lines.append(f"{label:<{width}}  {_told(name, before[name]):>10}  {_told(name, after[name]):>10}{change}")
    return lines


def work_lines(result: JobResult[Any]) -> list[str]:
    """Steps and seconds, of every level and of all."""
    lines = []
    if len(result.levels) > 1:
        for number, level in enumerate(result.levels):
            lines.append(
                f"level {number}: {level.topology.num_vertices} vertices, {level.steps} steps in {len(level.runs)} "
                f"runs, {level.seconds:.2f} s"
            )
    runs = len(result.runs)
    spent = f"{result.steps} steps in {runs} run{'s' * (runs != 1)}, {result.seconds:.2f} s"
    return [*lines, f"{spent}: {result.message}"]


def kept_lines(result: JobResult[Any]) -> list[str]:
    """What was promised and holds."""
    return [f"kept: {promise}" for promise in result.promises if promise.holds]


def missed_lines(result: JobResult[Any], asked_levels: int, names: Names = FROM_ZERO) -> list[str]:
    """What was asked for and is not there, in the numbers of a file."""
    lines = [promise.told(names) for promise in result.promises if not promise.holds]
    if len(result.levels) <= asked_levels:
        lines.append(f"{len(result.levels) - 1} of {asked_levels} refinements: NOT REACHED; {result.message}")
    return lines


def note_lines(repairs: Sequence[str], notes: Sequence[str], missed: Sequence[str]) -> list[str]:
    """Repairs of the input, and notes but those that are said at the end."""
    said = [f"note: {note}" for note in notes if not any(note.endswith(line) for line in missed)]
    return [*(f"repaired: {sentence}" for sentence in repairs), *said]


def _percent(before: float, after: float) -> str:
    return f"  {100.0 * (after / before - 1.0):+.1f} %" if before else ""


def _told(name: str, value: float) -> str:
    return "flat" if name == "energy_over_curvature" and math.isnan(value) else _number(value)


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.5g}"
