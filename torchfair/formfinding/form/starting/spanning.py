"""Surfaces that span rims, by all ways that there are, each with even triangles."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import torch

from ....curves import ClosedCurve
from ....geometry import ReferenceSurface
from ....topology import Topology
from .counting import edge_length, with_so_many
from .hulls import hull_between
from .patch import Floats, Ints, Mask, Patch, face_vectors, rim_edges, rim_vertices
from .plans import crossing_pairs, directions_of_view, plan_axes, right_in_plan, triangulated_plan, widths
from .relaxing import harmonic_heights, smaller_area
from .remeshing import Surface
from .stitching import least_area_band, least_area_disk

_COARSE, _MOST = 64, 160  # points of a rim: to estimate the area, and to span it by dynamic programming

Base = Callable[[Sequence[int]], "Patch | None"]
"""Triangles between the points of rims with so many points each."""


def spanning_patches(curves: Sequence[ClosedCurve], count: int) -> Iterator[Patch]:
    """Meshes of about ``count`` vertices between the curves, one for every way that works, the most reliable first.

    Over the plan, where the curves are seen from somewhere without crossings; such a mesh cannot run through itself.
    Then surfaces of least area between the points of one curve or two; between several the convex hull, and what is the
    convex hull of their directions from the middle.
    """
    direction = _direction(curves)
    if direction is not None:
        yield from _even(
            curves, count, lambda counts: _over_plan(curves, counts, direction),
            lambda _: lambda patch: harmonic_heights(patch, direction), direction,
        )  # fmt: skip
    if len(curves) == 1:
        yield from _even(curves, count, lambda counts: _disk(curves, counts), lambda _: smaller_area)
    elif len(curves) == 2:
        yield from _even(curves, count, lambda counts: _band(curves, counts), onto)
    if len(curves) > 1:
        yield from _even(curves, count, lambda counts: _hull(curves, counts), onto)
        yield from _even(curves, count, lambda counts: _hull(curves, counts, seen_from_inside=True), onto)


def _direction(curves: Sequence[ClosedCurve]) -> Floats | None:
    """The direction from which the curves are seen without crossings and enclose most; None if there is none."""
    counts = [max(_COARSE, 2 * len(curve.corners)) for curve in curves]
    rim, edges = rim_vertices(curves, counts), rim_edges(counts)
    areas = [_area_vector(rim.points[rim.rims == number]) for number in range(len(curves))]
    largest = max(areas, key=lambda area: float(np.linalg.norm(area)))
    size = float(np.linalg.norm(largest))
    ways = directions_of_view(rim.points)
    ways = np.concatenate([largest[None] / size, ways, -ways]) if size > 0.0 else np.concatenate([ways, -ways])
    ways = ways[np.argsort(-(ways @ largest), kind="stable")]
    extent = np.ptp(rim.points, axis=0).max()
    for way in ways[ways @ largest > 1e-3 * extent**2]:
        if not len(crossing_pairs(rim.points @ plan_axes(way).T, edges)):
            found: Floats = way
            if triangulated_plan(rim, edges, curves, way) is not None:
                return found
    return None


def _area_vector(points: Floats) -> Floats:
    area: Floats = 0.5 * np.cross(points, np.roll(points, -1, axis=0)).sum(0)
    return area


# ---- coarse triangles ----------------------------------------------------------------------------------


def _over_plan(curves: Sequence[ClosedCurve], counts: Sequence[int], direction: Floats) -> Patch | None:
    return triangulated_plan(rim_vertices(curves, counts), rim_edges(counts), curves, direction)


def _disk(curves: Sequence[ClosedCurve], counts: Sequence[int]) -> Patch:
    rim = rim_vertices(curves, counts)
    return rim._replace(faces=least_area_disk(rim.points))


def _band(curves: Sequence[ClosedCurve], counts: Sequence[int]) -> Patch:
    rim = rim_vertices(curves, counts)
    first, second = (np.flatnonzero(rim.rims == number) for number in (0, 1))
    found = []
    for there in (second, second[::-1]):
        faces, cost = least_area_band(rim.points[first], rim.points[there])
        found.append((cost, np.concatenate([first, there])[faces]))
    return rim._replace(faces=min(found, key=lambda one: one[0])[1])


def _hull(curves: Sequence[ClosedCurve], counts: Sequence[int], *, seen_from_inside: bool = False) -> Patch | None:
    rim = rim_vertices(curves, counts)
    points = rim.points
    if seen_from_inside:
        middle = np.mean([points[rim.rims == number].mean(0) for number in range(len(curves))], axis=0)
        points = (points - middle) / np.linalg.norm(points - middle, axis=1, keepdims=True).clip(1e-300)
    faces = hull_between(points, rim.rims, rim_edges(counts))
    return None if faces is None else rim._replace(faces=faces)


# ---- even triangles ------------------------------------------------------------------------------------


def _even(
    curves: Sequence[ClosedCurve], count: int, base: Base, surface_of: Callable[[Patch], Surface],
    direction: Floats | None = None,
) -> Iterator[Patch]:  # fmt: skip
    """The base with even triangles, about ``count`` vertices, where a function puts them; nothing without a base.

    With a direction, all triangles keep the side that is seen from there.
    """
    length = sum(curve.length for curve in curves)
    rough = base(_counts(curves, length / (_COARSE * len(curves))))
    if rough is None:
        return
    size = edge_length(_area(rough), length, count)
    most = _MOST if direction is None else 2 * count
    patch = base(_counts(curves, max(size, length / most)))
    if patch is None:
        return
    right: Callable[[Floats, Ints], Mask] = either_way if direction is None else right_in_plan(direction)
    surface = surface_of(patch)
    across = widths(patch, [curve.length for curve in curves])
    yield with_so_many(patch, curves, count, (size, patch.points, across), right, surface)


def onto(base: Patch) -> Surface:
    """The nearest places of the base."""
    reference = ReferenceSurface(torch.from_numpy(base.points), Topology.from_faces(torch.from_numpy(base.faces)))
    return lambda patch: reference.closest(torch.from_numpy(patch.points)).positions.numpy()


def _counts(curves: Sequence[ClosedCurve], size: float) -> list[int]:
    return [max(6, 2 * len(curve.corners), round(curve.length / size)) for curve in curves]


def either_way(points: Floats, faces: Ints) -> Mask:
    """Lets triangles (F, 3) lie as they like."""
    return np.ones(len(faces), bool)


def _area(patch: Patch) -> float:
    return float(0.5 * np.linalg.norm(face_vectors(patch.points, patch.faces), axis=1).sum())
