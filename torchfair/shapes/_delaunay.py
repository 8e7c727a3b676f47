"""Delaunay triangulations of a rectangle that may close up in either direction, and edge flips on the surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from torchfair.errors import MeshError

Ints = npt.NDArray[np.int64]
Points = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_JITTER = 1e-6


class Triangulation(NamedTuple):
    """Triangles of a periodic point set.

    Attributes:
        faces: (F, 3) point numbers, counterclockwise.
        tiles: (F, 3, 2) how many periods each corner is away from its point, for one placement of the triangle.
    """

    faces: Ints
    tiles: Ints


def triangulate(points: Points, fixed: Mask, size: tuple[float, float], periodic: tuple[bool, bool]) -> Triangulation:
    """Delaunay triangulation of points ``(N, 2)`` in ``[0, size[0]] x [0, size[1]]``.

    Points marked ``fixed`` lie on the boundary; all others are moved by a millionth of their mean distance, the
    same in every copy, so that ties (four points on a circle) are decided alike everywhere.
    """
    from scipy.spatial import Delaunay

    spacing = np.sqrt(size[0] * size[1] / len(points))
    noise = np.random.default_rng(0).uniform(-1, 1, points.shape) * (_JITTER * spacing)
    moved = points + np.where(fixed[:, None], 0.0, noise)
    owners, tiles = _copies(points, size, periodic)
    placed = moved[owners] + tiles * np.array(size)
    simplices = Delaunay(placed).simplices.astype(np.int64)
    corners = placed[simplices]
    area = _area(corners)
    simplices[area < 0] = simplices[area < 0][:, ::-1]
    centre = corners.mean(1)
    keep = np.abs(area) > 1e-9 * spacing**2  # none are left of three points on one side of the rectangle
    for axis in range(2):
        if periodic[axis]:
            keep &= (centre[:, axis] > -0.01 * size[axis]) & (centre[:, axis] < 1.01 * size[axis])
    return _one_of_each(owners[simplices[keep]], tiles[simplices[keep]])


def _area(corners: Points) -> Points:
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area: Points = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return area


def _copies(points: Points, size: tuple[float, float], periodic: tuple[bool, bool]) -> tuple[Ints, Ints]:
    """Numbers and tiles of the points and of their copies up to half a period outside."""
    owners, tiles = np.arange(len(points)), np.zeros((len(points), 2), np.int64)
    for axis in range(2):
        if periodic[axis]:
            place = points[owners, axis] / size[axis]
            shift = np.zeros(2, np.int64)
            shift[axis] = 1
            low, high = place < 0.5, place >= 0.5
            tiles = np.concatenate([tiles, tiles[low] + shift, tiles[high] - shift])
            owners = np.concatenate([owners, owners[low], owners[high]])
    return owners, tiles


def _one_of_each(faces: Ints, tiles: Ints) -> Triangulation:
    """One placement of every triangle that occurs, up to whole periods."""
    rows = np.arange(len(faces))[:, None]
    turn = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    faces, tiles = faces[rows, turn], tiles[rows, turn]
    tiles = tiles - tiles[:, :1]
    keys = np.concatenate([faces, tiles.reshape(-1, 6)], axis=1)
    chosen = np.unique(keys, axis=0)
    faces, tiles = chosen[:, :3], chosen[:, 3:].reshape(-1, 3, 2)
    if _closes_on_itself(faces, tiles):
        raise MeshError("the mesh is too coarse to close up around the surface. Ask for more vertices.")
    return Triangulation(faces, tiles)


def _closes_on_itself(faces: Ints, tiles: Ints) -> bool:
    """Whether a vertex is its own neighbour, or two vertices are joined by two edges that go different ways."""
    turn = [1, 2, 0]
    edges = np.concatenate([faces.reshape(-1, 1), faces[:, turn].reshape(-1, 1)], axis=1)
    steps = (tiles[:, turn] - tiles).reshape(-1, 2)
    backwards = edges[:, 0] > edges[:, 1]
    edges[backwards], steps[backwards] = edges[backwards][:, ::-1], -steps[backwards]
    ways = np.unique(np.concatenate([edges, steps], axis=1), axis=0)
    return bool((edges[:, 0] == edges[:, 1]).any()) or len(ways) > len(np.unique(edges, axis=0))


_ROUNDS = 200


def flip_to_delaunay(vertices: Points, faces: Ints, right: Callable[[Points, Ints], Mask] | None = None) -> Ints:
    """Flips interior edges whose two opposite angles, measured in space, add up to more than 180 degrees.

    Every round flips a set of edges no two of which share a face; it ends when there are none. An edge is not
    flipped onto an existing one, nor where ``right`` (vertices and faces to a mask) is False of a face that comes.
    """
    faces = faces.copy()
    for _ in range(_ROUNDS):
        flaps, sides = _flaps(faces)
        excess = _cotangents(vertices, flaps)
        candidates = np.flatnonzero(excess < -1e-9)
        candidates = candidates[np.argsort(excess[candidates], kind="stable")]
        new = np.sort(flaps[candidates, 2:], axis=1)
        n = len(vertices)
        existing = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        candidates = candidates[~np.isin(new @ [n, 1], existing @ [n, 1])]
        if right is not None:
            v, w, a, b = flaps[candidates].T
            candidates = candidates[right(vertices, np.stack([v, b, a], 1)) & right(vertices, np.stack([b, w, a], 1))]
        if not candidates.size:
            break
        rank = np.full(len(faces), len(candidates))
        order = np.arange(len(candidates))
        np.minimum.at(rank, sides[candidates].ravel(), np.repeat(order, 2))
        chosen = candidates[(rank[sides[candidates]] == order[:, None]).all(1)]
        chosen = chosen[np.unique(np.sort(flaps[chosen, 2:], axis=1) @ [n, 1], return_index=True)[1]]
        v, w, a, b = flaps[chosen].T
        faces[sides[chosen, 0]] = np.stack([v, b, a], axis=1)
        faces[sides[chosen, 1]] = np.stack([b, w, a], axis=1)
    return faces


def _flaps(faces: Ints) -> tuple[Ints, Ints]:
    """For each interior edge its vertices ``v, w, a, b`` (a left, b right) and its left and right face."""
    tails, heads, tips = faces.ravel(), faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()
    n = int(faces.max()) + 1
    forward = np.flatnonzero(tails < heads)
    keys = heads * n + tails  # of a half-edge, the key of the one opposite
    order = np.argsort(keys, kind="stable")
    place = np.searchsorted(keys[order], tails[forward] * n + heads[forward])
    place = np.minimum(place, len(keys) - 1)
    twin = order[place]
    interior = keys[twin] == tails[forward] * n + heads[forward]
    left, right = forward[interior], twin[interior]
    return np.stack([tails[left], heads[left], tips[left], tips[right]], axis=1), np.stack(
        [left // 3, right // 3], axis=1
    )


def _cotangents(vertices: Points, flaps: Ints) -> Points:
    """Sum of the cotangents of the two angles opposite each edge: negative if they exceed 180 degrees."""
    v, w, a, b = (vertices[column] for column in flaps.T)
    with np.errstate(divide="ignore", invalid="ignore"):  # minus infinity at angles of 180 degrees, nan without sides
        total: Points = sum(
            (p * q).sum(1) / np.linalg.norm(np.cross(p, q), axis=1) for p, q in ((v - a, w - a), (v - b, w - b))
        )
    return total
