"""Rims that are seen from somewhere without crossings: triangles in that plane, and sizes that fit between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...._graph import connected
from ....curves import ClosedCurve
from .patch import Edges, Floats, Ints, Mask, Patch, edges_of, middle_parameters
from .remeshing import on_curves

_DIRECTIONS = 200  # on a half sphere
_SPLITS = 40  # rounds in which boundary edges that are missing are halved
_MOST = 6  # times as many vertices as at first: a plan that needs more is nearly seen from its side
_APART = 3.0  # vertices of one rim face each other if the way along it is so many times the way across
ROWS = 2.5  # between two sides of the rim that face each other
_GRADE = 0.3  # by how much sizes grow over a unit of length
_LEAST_SIZE = 0.1  # of the size elsewhere


def directions_of_view(points: Floats) -> Floats:
    """(n, 3) unit vectors, the one along which points (n, 3) extend least first, then those along axes, then others."""
    centred = points - points.mean(0)
    principal = np.linalg.svd(centred, full_matrices=False)[2][::-1]
    number = np.arange(_DIRECTIONS) + 0.5
    height, turn = 1.0 - number / _DIRECTIONS, number * np.pi * (3.0 - np.sqrt(5.0))
    spread = np.stack([np.cos(turn) * np.sqrt(1 - height**2), np.sin(turn) * np.sqrt(1 - height**2), height], 1)
    return np.concatenate([principal[:1], np.eye(3)[::-1], principal[1:], spread])


def plan_axes(direction: Floats) -> Floats:
    """(2, 3) axes of the plane that is seen along a unit vector; with it a right-handed system."""
    helper = np.eye(3)[np.abs(direction).argmin()]
    first = np.cross(helper, direction)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])


def crossing_pairs(plan: Floats, edges: Ints) -> Ints:
    """(n, 2) edges (E, 2) between points (P, 2) that touch or cross each other without a common end."""
    p, q = plan[edges[:, 0]], plan[edges[:, 1]]
    low, high = np.minimum(p, q), np.maximum(p, q)
    i, j = np.nonzero(np.triu(((low[:, None] <= high) & (low <= high[:, None])).all(2), 1))
    apart = (edges[i][:, :, None] != edges[j][:, None, :]).all((1, 2))
    i, j = i[apart], j[apart]

    def side(a: Floats, b: Floats, c: Floats) -> Floats:
        u, v = b - a, c - a
        turn: Floats = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        return turn

    cross = side(p[i], q[i], p[j]) * side(p[i], q[i], q[j]) <= 0
    cross &= side(p[j], q[j], p[i]) * side(p[j], q[j], q[i]) <= 0
    return np.stack([i[cross], j[cross]], 1)


def triangulated_plan(patch: Patch, edges: Ints, curves: Sequence[ClosedCurve], direction: Floats) -> Patch | None:
    """Delaunay triangles of what the rims enclose in the plan; boundary edges that miss are halved on their curves.

    None if the rims cross each other in the plan, do not lie in one of them, or are not covered in the end.
    """
    from scipy.spatial import Delaunay

    axes, most = plan_axes(direction), _MOST * len(patch.points)
    for _ in range(_SPLITS):
        plan = patch.points @ axes.T
        if len(plan) > most or len(crossing_pairs(plan, edges)):
            return None
        faces = Delaunay(plan).simplices.astype(np.int64)
        faces[_areas(plan, faces) < 0] = faces[_areas(plan, faces) < 0][:, ::-1]
        faces = faces[_areas(plan, faces) > 1e-12 * np.ptp(plan, axis=0).max() ** 2]
        missing = ~_contains(edges_of(faces), edges, len(plan))
        if not missing.any():
            faces = faces[_enclosed(plan[faces].mean(1), plan, edges)]
            result = patch._replace(faces=faces)
            return result if _covers(result, edges) else None
        patch, edges = _halved(patch, edges, missing, curves)
    return None


def _areas(plan: Floats, faces: Ints) -> Floats:
    a, b, c = plan[faces].transpose(1, 0, 2)
    u, v = b - a, c - a
    areas: Floats = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return areas


def right_in_plan(direction: Floats) -> Callable[[Floats, Ints], Mask]:
    """Whether triangles between points (V, 3) run counterclockwise where they are seen from the direction."""
    axes = plan_axes(direction)

    def right(points: Floats, faces: Ints) -> Mask:
        plan = points @ axes.T
        longest = np.linalg.norm(points[faces] - points[np.roll(faces, 1, axis=1)], axis=2).max(1)
        above: Mask = _areas(plan, faces) > 1e-3 * longest**2
        return above

    return right


def _contains(known: Edges, edges: Ints, count: int) -> Mask:
    keys = np.sort(edges, axis=1) @ np.array([count, 1])
    found: Mask = np.isin(keys, known.ends @ np.array([count, 1]))
    return found


def _enclosed(places: Floats, plan: Floats, edges: Ints) -> Mask:
    """Whether places (n, 2) have an odd number of edges to their right."""
    p, q = plan[edges[:, 0]], plan[edges[:, 1]]
    result = np.zeros(len(places), bool)
    for a, b in zip(p, q, strict=True):
        between = (a[1] > places[:, 1]) != (b[1] > places[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a[0] + (places[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        result ^= between & (places[:, 0] < at)
    return result


def _covers(patch: Patch, edges: Ints) -> bool:
    """Whether the boundary of the faces is the rims, and they hang together."""
    if not len(patch.faces):
        return False
    known = edges_of(patch.faces)
    if int(known.boundary.sum()) != len(edges) or not _contains(known, edges, len(patch.points)).all():
        return False
    return not connected(known.ends, len(patch.points)).any()


def _halved(patch: Patch, edges: Ints, chosen: Mask, curves: Sequence[ClosedCurve]) -> tuple[Patch, Ints]:
    a, b = edges[chosen].T
    new = len(patch.points) + np.arange(len(a))
    rims, parameters = patch.rims[a], middle_parameters(patch.parameters[a], patch.parameters[b])
    points = on_curves(patch.points[a], rims, parameters, curves)
    longer = Patch(
        np.concatenate([patch.points, points]), patch.faces, np.concatenate([patch.rims, rims]),
        np.concatenate([patch.parameters, parameters]), np.concatenate([patch.corners, np.zeros(len(a), bool)]),
    )  # fmt: skip
    return longer, np.concatenate([edges[~chosen], np.stack([a, new], 1), np.stack([new, b], 1)])


# ---- sizes ---------------------------------------------------------------------------------------------


def widths(patch: Patch, lengths: Sequence[float]) -> Floats:
    """(V,) how far vertices of a triangulation without inner vertices are from the side of the rim that they face.

    Infinity where none is faced: circumscribed circles of triangles that reach across are as wide as the rim there.
    """
    p = patch.points[patch.faces]
    result = np.full(len(patch.points), np.inf)
    sides = [(1, 2), (2, 0), (0, 1)]
    gaps = [np.linalg.norm(p[:, i] - p[:, j], axis=1) for i, j in sides]
    area = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    across = 0.5 * gaps[0] * gaps[1] * gaps[2] / np.maximum(area, 1e-300)  # the diameter
    faces_each_other = np.zeros(len(p), bool)
    for (i, j), gap in zip(sides, gaps, strict=True):
        a, b = patch.faces[:, i], patch.faces[:, j]
        way = np.abs(np.remainder(patch.parameters[a] - patch.parameters[b] + 0.5, 1.0) - 0.5)
        way *= np.asarray(lengths)[patch.rims[a]]
        faces_each_other |= (patch.rims[a] != patch.rims[b]) | (way > _APART * gap)
    for corner in patch.faces.T:
        np.minimum.at(result, corner[faces_each_other], across[faces_each_other])
    return result


class Sizes:
    """Wanted edge lengths: as asked for, but so short where the rim is narrow that some rows fit in.

    Args:
        size: Asked for.
        places: (n, 3) on the rim.
        across: (n,) its width there.
    """

    def __init__(self, size: float, places: Floats, across: Floats) -> None:
        from scipy.spatial import cKDTree

        own = np.clip(across / ROWS, _LEAST_SIZE * size, size)
        narrow = own < size
        self.size, self._own = size, own[narrow]
        self._tree = cKDTree(places[narrow]) if narrow.any() else None

    def __call__(self, places: Floats) -> Floats:
        """Wanted lengths (n,) at places (n, 3)."""
        if self._tree is None:
            return np.full(len(places), self.size)
        count = min(8, len(self._own))
        distances, nearest = self._tree.query(places, k=[*range(1, count + 1)])
        wanted: Floats = np.minimum(self.size, (self._own[nearest] + _GRADE * distances).min(1))
        return wanted
