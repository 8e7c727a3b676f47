"""Vertices and triangles in an order that follows from geometry, so that how they were numbered decides nothing."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor

from .._graph import face_components
from ..fields.frames import Floats, Ints
from ..topology import Topology
from ..triangulation import triangulate

TIE = 1e-7
"""Of the size of the surface, below which lengths count as equal."""

_STEPS = 200_000  # of walks that are compared, all together


def numbered_by_geometry(points: Tensor, triangles: Tensor) -> tuple[Tensor, Tensor]:
    """An order of the vertices, and the triangles in it: the same for all numberings of a surface.

    It is that of a walk over the triangles, breadth first and counterclockwise, from a side of one of them. Of all
    sides that one is taken whose start is farthest from the centroid; of several such by the other corners, the
    lengths of sides, then by what walks from them meet, and at last by coordinates. Those decide only between sides
    that a symmetry of the surface brings to each other. So the order is that after rigid motions and changes of scale,
    too, up to symmetries.

    Args:
        points: (V, 3).
        triangles: (F, 3), oriented alike and joined by edges; every vertex is in one.

    Returns:
        The old numbers (V,) of vertices in the new order; triangles (F, 3) in the new order, of new numbers, each from
        the corner at which it was entered on.
    """
    corners = triangles.numpy()
    across = _across(corners).tolist()
    sides = np.array(_walked(_first(_keys(points.numpy(), corners), across), across, len(corners)))
    entered = corners[sides[:, None] // 3, (sides[:, None] + np.arange(3)) % 3]
    found, first = np.unique(entered, return_index=True)
    order = found[np.argsort(first)]
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(len(order))
    return torch.from_numpy(order), torch.from_numpy(number[entered])


def triangles_by_geometry(points: Tensor, topology: Topology) -> Tensor:
    """Triangles (n, 3) of the faces of a mesh in order, the same wherever faces start and whatever is rounded.

    Quads are cut as :func:`torchfair.triangulation.triangulate` cuts them, so that the smaller triangle is as large as
    it can be. Where it is as large either way, as in parallelograms, the shorter diagonal decides, then that with an
    end farther from the middle of the component, then coordinates: what else is in the mesh decides nothing.
    """
    whole = triangulate(points, _turned(points, topology))
    if 4 not in topology.faces_by_size:
        return whole.triangles
    is_other = topology.face_sizes[whole.faces] != 4
    numbers, quads = (of.numpy() for of in topology.faces_by_size[4])
    labels, sizes = face_components(topology).numpy(), topology.face_sizes.numpy()
    corners, of_corners = topology.corners.numpy(), np.repeat(labels, sizes)
    cut = np.empty((len(quads), 2, 3), np.int64)
    for label in np.unique(labels[numbers]):
        own, inside = labels[numbers] == label, np.unique(corners[of_corners == label])
        cut[own] = inside[_cut_quads(points[inside].numpy(), np.searchsorted(inside, quads[own]))]
    faces = np.concatenate([whole.faces[is_other].numpy(), np.repeat(numbers, 2)])
    found = torch.cat([whole.triangles[is_other], torch.from_numpy(cut.reshape(-1, 3))])
    return found[torch.from_numpy(np.argsort(faces, kind="stable"))]


def _turned(points: Tensor, topology: Topology) -> Topology:
    """The faces from the corners with the largest coordinates on."""
    rank = np.unique(points.numpy(), axis=0, return_inverse=True)[1].reshape(-1)
    faces: list[list[int]] = [[]] * topology.num_faces
    for size, (numbers, corners) in topology.faces_by_size.items():
        first = rank[corners.numpy()].argmax(1)[:, None]
        turned = np.take_along_axis(corners.numpy(), (first + np.arange(size)) % size, 1)
        for number, face in zip(numbers.tolist(), turned.tolist(), strict=True):
            faces[number] = face
    return Topology.from_faces(faces, topology.num_vertices)


def _cut_quads(points: Floats, corners: Ints) -> Ints:
    """(n, 2, 3) triangles of the quads of a component."""
    apart = points - points.mean(0)
    far = np.linalg.norm(apart, axis=1)
    size = far.max()
    fans = [np.roll(corners, -k, axis=1)[:, [[0, 1, 2], [0, 2, 3]]] for k in (0, 1)]
    sides = [[*_signs(apart, fan, size, far)] for fan in fans]
    second, open_ = np.zeros(len(corners), bool), np.ones(len(corners), bool)
    for one, other in zip(*sides, strict=True):
        decides = open_ & (np.abs(other - one) > TIE)
        second[decides] = (other > one)[decides]
        open_ &= ~decides
    return np.where(second[:, None, None], fans[1], fans[0])


def _signs(points: Floats, fan: Ints, size: float, far: Floats) -> Iterator[Floats]:
    """(n,) each: what makes one way to cut quads better than the other, for both triangles of each (n, 2, 3)."""
    a, b, c = points[fan].transpose(2, 0, 1, 3)
    areas = np.cross(b - a, c - a)
    whole = areas.sum(1, keepdims=True)
    yield (areas * whole).sum(2).min(1) / np.maximum((whole**2).sum((1, 2)), 1e-300)
    ends = fan[:, 0, [0, 2]]
    yield -np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1) / size
    yield far[ends].max(1) / size
    yield from (points[ends].max(1) / size).T


def _across(triangles: Ints) -> Ints:
    """(3F,) every side seen from the neighbour, that after corner k of triangle f being 3 f + k; -1 at the boundary."""
    start, end = triangles.ravel(), np.roll(triangles, -1, 1).ravel()
    size = int(triangles.max()) + 1
    forward, backward = start * size + end, end * size + start
    order = np.argsort(forward)
    place = np.minimum(np.searchsorted(forward, backward, sorter=order), len(order) - 1)
    other = order[place]
    return np.where(forward[other] == backward, other, -1)


def _keys(points: Floats, triangles: Ints) -> list[Floats]:
    """(3F,) each: what tells sides from each other, in the size of the surface, the first before the others."""
    corners = points[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    apart = points - areas @ corners.mean(1) / areas.sum()
    far = np.linalg.norm(apart, axis=1)
    lengths = np.linalg.norm(np.roll(corners, -1, 1) - corners, axis=2)
    seen = [far[triangles], lengths, *(apart[triangles][..., k] for k in range(3))]
    return [np.roll(of, -k, 1).ravel() / far.max() for of in seen for k in range(3)]


def _first(keys: list[Floats], across: list[int]) -> int:
    """The side that comes first by keys, of which the last nine are coordinates, walks before these."""
    sides = _largest(np.arange(len(keys[0])), keys[:6])
    steps = 32
    while len(sides) > 1 and len(sides) * steps <= _STEPS:
        sides = _by_walks(sides, keys[:6], across, steps)
        if steps >= len(across) // 3:
            break
        steps *= 4
    return int(_largest(sides, keys[6:])[0])


def _largest(sides: Ints, keys: list[Floats]) -> Ints:
    for key in keys:
        if len(sides) == 1:
            break
        here = key[sides]
        sides = sides[here >= here.max() - TIE]
    return sides


def _by_walks(sides: Ints, keys: list[Floats], across: list[int], steps: int) -> Ints:
    """Those of some sides whose walks meet what comes first by the keys."""
    met = np.array([_walked(side, across, steps) for side in sides.tolist()])
    seen = np.stack([key[met] for key in keys], 2).reshape(len(sides), -1)
    while (differ := np.ptp(seen, axis=0) > TIE).any():
        here = seen[:, np.argmax(differ)]
        kept = here >= here.max() - TIE
        seen, sides = seen[kept], sides[kept]
    return sides


def _walked(start: int, across: list[int], steps: int) -> list[int]:
    """The sides by which so many triangles are entered, in order."""
    visited, queue = {start // 3}, deque([start])
    walk: list[int] = []
    while queue and len(walk) < steps:
        side = queue.popleft()
        walk.append(side)
        for k in range(3):
            other = across[side // 3 * 3 + (side + k) % 3]
            if other >= 0 and other // 3 not in visited:
                visited.add(other // 3)
                queue.append(other)
    return walk
