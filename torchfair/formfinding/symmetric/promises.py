"""What the design of principal-symmetric meshes promises."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..job.promises import Promise, handle_promise
from .settings import SymmetricSettings

_LARGEST_DISTANCE = 0.1  # mean edges
_MORE_ENERGY = 1.01


def symmetric_promises(
    settings: SymmetricSettings,
    before: Mapping[str, float],
    after: Mapping[str, float],
    *,
    has_handles: bool,
    keeps_shape: bool,
) -> list[Promise]:
    """What is asked of a mesh, and what its measures are, see :func:`~torchfair.formfinding.symmetric_measures`."""
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
        promises += _of_kept_shapes(before, after)
    if has_handles:
        away = after["largest_handle_distance"] / after["mean_edge_length"]
        promises.append(handle_promise(away, 1.0, unit="mean edges", remedy=of_pulls))
    return promises


def _of_kept_shapes(before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
    """The mesh is where it was, and not less smooth; flat ones have no E/C."""
    away, name = after["largest_distance_from_start"], "distance from the surface at the start"
    of_edges = "choose principal edges that follow principal directions better, remesh along these, or free the shape"
    promises = [Promise(name, _LARGEST_DISTANCE, away, unit="mean edges", remedy=of_edges)]
    asked, reached = _MORE_ENERGY * before["energy_over_curvature"], after["energy_over_curvature"]
    if math.isfinite(asked):
        promises.append(Promise("E/C", asked, reached, remedy=of_edges))
    return promises
