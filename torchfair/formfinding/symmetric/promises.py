"""What the design of principal-symmetric meshes promises."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...settings.symmetric_settings import SymmetricSettings
from ..job.promises import Promise, handle_promise
from .kept_shape import LARGEST_DISTANCE, MORE_ENERGY

_LEAST_AREA = 0.9  # of that of the mesh that was given, where the shape is kept
_LEAST_FREE_AREA = 0.5  # where it is free; below, the mesh has begun to collapse
_OF_GIVEN = " over that of the mesh that was given"


def symmetric_promises(
    settings: SymmetricSettings,
    before: Mapping[str, float],
    after: Mapping[str, float],
    first: Mapping[str, float] | None = None,
    *,
    has_handles: bool,
    keeps_shape: bool,
) -> list[Promise]:
    """What is asked of a mesh, and what its measures are, see :func:`~torchfair.formfinding.symmetric_measures`.

    Args:
        settings: Of the job.
        before: Measures of the mesh on which the level starts.
        after: Those of the result.
        first: Measures of the mesh that was given, where that was refined; None where it starts this level.
        has_handles: Whether vertices are pulled.
        keeps_shape: Whether the shape is kept.
    """
    largest = max(after["largest_cospherical"], after["largest_coplanar"])
    wrong = round((1.0 - after["saddle_side_share"]) * after["negative_stars"])
    crossing = after["crossing_pyramids_negative"]
    of_lines = "choose principal edges along the smaller curvature, or a coarser spacing along than across them"
    of_pulls = "pull less, or free other vertices"
    promises = [
        Promise(
            "largest relative residual of the conditions",
            settings.tolerance,
            largest,
            remedy="fix fewer vertices, pull less, or allow more steps",
        ),
        Promise("negatively curved vertices with a principal neighbour on the wrong side", 0, wrong, remedy=of_lines),
        Promise("negatively curved vertices with a pyramid that intersects itself", 0, crossing, remedy=of_lines),
        Promise("faces turned over against their neighbours", before["flipped_faces"], after["flipped_faces"]),
    ]
    if keeps_shape:
        promises += _of_kept_shapes(before, after, first)
    elif settings.second_differences or not has_handles:  # handles may well pull a mesh together
        of_area = "leave out --free and presets, fix vertices, or give handles or a reference that hold it"
        promises.append(_of_area(_LEAST_FREE_AREA, first or before, after, of_area))
    if has_handles:
        away = after["largest_handle_distance"] / after["mean_edge_length"]
        promises.append(handle_promise(away, 1.0, unit="mean edges", remedy=of_pulls))
    return promises


def _of_area(share: float, given: Mapping[str, float], after: Mapping[str, float], remedy: str) -> Promise:
    return Promise(f"area{_OF_GIVEN}", share, after["area"] / given["area"], sense="at least", remedy=remedy)


def _of_kept_shapes(
    before: Mapping[str, float], after: Mapping[str, float], first: Mapping[str, float] | None
) -> list[Promise]:
    """The mesh is where it was, and not less smooth; flat ones have no E/C."""
    given = first or before
    away = after["largest_distance_from_start"]
    name = f"distance from the mesh {'that was given' if first is None else 'of this level before it was solved'}"
    of_edges = (
        "choose principal edges that follow principal directions better, remesh along these (torchfair mesh "
        "--triangles), or free the shape"
    )
    promises = [Promise(name, LARGEST_DISTANCE, away, unit="mean edges", remedy=of_edges)]
    promises.append(_of_area(_LEAST_AREA, given, after, "refine less, or start from a finer mesh"))
    largest, words = given["energy_over_curvature"], _OF_GIVEN
    if before["energy_over_curvature"] > largest:  # refinement alone raises it where edges are long
        largest, words = before["energy_over_curvature"], f"{_OF_GIVEN}, refined"
    if math.isfinite(largest):
        ratio = after["energy_over_curvature"] / largest
        promises.append(Promise(f"E/C{words}", MORE_ENERGY, ratio, remedy=of_edges))
    return promises
