"""Vertices and triangles in an order that follows from geometry, so that how they were numbered decides nothing."""

from __future__ import annotations

from collections import deque

import numpy as np
import torch
from torch import Tensor

from ..fields.frames import Floats, Ints
from ..topology import Topology

_TIE = 1e-7  # of the size of the surface, below which lengths count as equal


def numbered_by_geometry(points: Tensor, triangles: Tensor) -> tuple[Tensor, Tensor]:
    """An order of the vertices, and the triangles in it: the same for all numberings of a surface.

    It is that of a walk over the triangles, breadth first and counterclockwise, from a side of one of them. Of all
    sides that one is taken whose start is farthest from the centroid; of several such by the other corners, the
    lengths of sides, and at last by coordinates. Those decide only on surfaces with symmetries; elsewhere the order is
    the same after rigid motions and changes of scale, too.

    Args:
        points: (V, 3).
        triangles: (F, 3), oriented alike and joined by edges; every vertex is in one.

    Returns:
        The old numbers (V,) of vertices in the new order; triangles (F, 3) in the new order, of new numbers, each from
        the corner at which it was entered on.
    """
    corners = triangles.numpy()
    sides = np.array(_walked(_first(_keys(points.numpy(), corners)), _across(corners).tolist()))
    entered = corners[sides[:, None] // 3, (sides[:, None] + np.arange(3)) % 3]
    found, first = np.unique(entered, return_index=True)
    order = found[np.argsort(first)]
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(len(order))
    return torch.from_numpy(order), torch.from_numpy(number[entered])


def turned_by_geometry(points: Tensor, topology: Topology) -> Topology:
    """The faces from the corners with the largest coordinates on, so that where they start says nothing."""
    _, rank = np.unique(points.numpy(), axis=0, return_inverse=True)
    faces: list[list[int]] = [[]] * topology.num_faces
    for size, (numbers, corners) in topology.faces_by_size.items():
        first = rank.reshape(-1)[corners.numpy()].argmax(1)
        turned = np.take_along_axis(corners.numpy(), (first[:, None] + np.arange(size)) % size, 1)
        for number, face in zip(numbers.tolist(), turned.tolist(), strict=True):
            faces[number] = face
    return Topology.from_faces(faces, topology.num_vertices)


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


def _first(keys: list[Floats]) -> int:
    sides = np.arange(len(keys[0]))
    for key in keys:
        if len(sides) == 1:
            break
        here = key[sides]
        sides = sides[here >= here.max() - _TIE]
    return int(sides[0])


def _walked(start: int, across: list[int]) -> list[int]:
    """The sides by which triangles are entered, in order."""
    visited, queue, walk = {start // 3}, deque([start]), []
    while queue:
        side = queue.popleft()
        walk.append(side)
        for k in range(3):
            other = across[side // 3 * 3 + (side + k) % 3]
            if other >= 0 and other // 3 not in visited:
                visited.add(other // 3)
                queue.append(other)
    return walk
