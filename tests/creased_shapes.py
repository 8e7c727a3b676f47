"""Surfaces with sharp edges, as triangles: their vertices lie on the creases."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from helpers import grid_faces
from torch import Tensor

from torchfair import Topology

Mesh = tuple[Tensor, Topology]
Arrays = tuple[np.ndarray, np.ndarray]


def welded(*patches: Arrays) -> Mesh:
    """One mesh of patches of triangles, their vertices joined where they coincide."""
    points = np.concatenate([points for points, _ in patches])
    offsets = np.cumsum([0, *(len(points) for points, _ in patches[:-1])])
    triangles = np.concatenate([faces + offset for (_, faces), offset in zip(patches, offsets, strict=True)])
    _, first, number = np.unique(np.rint(points * 1e7), axis=0, return_index=True, return_inverse=True)
    return torch.from_numpy(points[first]), Topology.from_faces(number.reshape(-1)[triangles], len(first))


def patch(
    place: Callable[[np.ndarray, np.ndarray], np.ndarray], rows: int, columns: int, crossed: bool = False
) -> tuple:
    """A grid of triangles: positions by two parameters from 0 to 1; ``crossed`` cuts quads both ways in turn."""
    u, v = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    quads = grid_faces(rows, columns)
    turned = (np.arange(len(quads)) % 2).astype(bool) & crossed
    cut = np.where(turned[:, None], np.roll(quads, 1, axis=1), quads)
    triangles = np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]])
    return np.stack(np.broadcast_arrays(*place(u, v)), -1).reshape(-1, 3), triangles


def box(count: int = 13, size: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Mesh:
    """Of chi 2, with 8 corners and 12 edges."""
    sides = []
    for axis in range(3):
        for end in (0, 1):

            def place(u: np.ndarray, v: np.ndarray, axis: int = axis, end: int = end) -> list[np.ndarray]:
                inside = (u, v) if end else (v, u)
                at = [0 * u] * 3
                at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3] = 0 * u + end, *inside
                return [x * s for x, s in zip(at, size, strict=True)]

            sides.append(patch(place, count, count))
    return welded(*sides)


def extruded(profile: np.ndarray, length: float = 1.0, count: int = 20) -> Mesh:
    """A curve in the plane of x and z, moved along y."""
    pieces = len(profile)

    def place(u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        x, z = profile[np.rint(u * (pieces - 1)).astype(int)].transpose(2, 0, 1)
        return [x, v * length, z]

    return welded(patch(place, pieces, count, crossed=True))


def folded_sheet() -> Mesh:
    """Two cylinders that meet in a straight ridge."""
    x = np.linspace(-1, 1, 31)
    return extruded(np.stack([x, 0.3 - 0.5 * np.abs(x) - 0.4 * x**2 + 0.1 * np.sign(x) * x**2], 1), 1.5, 24)


def tunnel_on_a_plane() -> Mesh:
    """Half a cylinder on a plane: concave right angles."""
    turn = np.linspace(math.pi, 0, 21)
    arc = np.stack([0.5 * np.cos(turn), 0.5 * np.sin(turn)], 1)
    flat = np.stack([np.linspace(-1, -0.5, 8), np.zeros(8)], 1)
    return extruded(np.concatenate([flat[:-1], arc, -flat[::-1][1:] * [1, -1]]), 1.5, 24)


def graph(height: Callable[[np.ndarray, np.ndarray], np.ndarray], count: int = 25) -> Mesh:
    """Over the square of side 2, its triangles cut along both diagonals of the square."""

    def place(u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        x, y = 2 * u - 1, 2 * v - 1
        return [x, y, height(x, y)]

    points, _ = patch(place, count, count)
    quads = grid_faces(count, count)
    middle = points[quads].mean(1)
    falls = middle[:, 0] * middle[:, 1] < 0
    cut = np.where(falls[:, None], np.roll(quads, 1, axis=1), quads)
    return welded((points, np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]])))


def pyramid() -> Mesh:
    """Four flat sides: creases along the diagonals, which follow no direction of the sides."""
    return graph(lambda x, y: 0.8 * (1 - np.maximum(np.abs(x), np.abs(y))))


def fading_fold() -> Mesh:
    """A ridge that ends inside the sheet."""
    return graph(lambda x, y: -0.8 * np.abs(x) * np.clip(-y, 0, 1) - 0.15 * x**2)


def can(slope: float = 0.0, around: int = 48) -> Mesh:
    """A cylinder with flat lids; the upper one leans by a slope."""

    def side(u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        x, y = np.cos(2 * math.pi * u), np.sin(2 * math.pi * u)
        return [x, y, v * (1.6 + slope * x)]

    def disk(u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
        """A square bent into a disk."""
        a, b = 2 * u - 1, 2 * v - 1
        r = np.maximum(np.abs(a), np.abs(b))
        turn = np.where(np.abs(a) >= np.abs(b), math.pi / 4 * b / np.where(a == 0, 1, a), 0)
        turn = np.where(np.abs(a) < np.abs(b), math.pi / 2 - math.pi / 4 * a / np.where(b == 0, 1, b), turn)
        turn = np.where(np.where(np.abs(a) >= np.abs(b), a, b) < 0, turn + math.pi, turn)
        return [r * np.cos(turn), r * np.sin(turn), 0 * r]

    count = around // 4 + 1
    points, faces = patch(disk, count, count)
    top = points.copy()
    top[:, 2] = 1.6 + slope * top[:, 0]
    return welded(patch(side, around + 1, 17), (top, faces), (points, faces[:, ::-1]))


def drilled_box(around: int = 48, count: int = 9) -> Mesh:
    """A square plate with a round hole through it: chi 0."""

    def turn(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.cos(2 * math.pi * u), np.sin(2 * math.pi * u)

    def square(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = turn(u)
        t = np.mod(u * 8 + 1, 8)  # one side is two of eight parts
        side, along = np.floor(t / 2).astype(int) % 4, np.mod(t, 2) - 1
        x = np.choose(side, [1 + 0 * along, -along, -1 + 0 * along, along])
        y = np.choose(side, [along, 1 + 0 * along, -along, -1 + 0 * along])
        return x, y

    def ring(z: float, up: bool) -> Arrays:
        def place(u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
            (x, y), (a, b) = turn(u), square(u)
            return [0.5 * x * (1 - v) + a * v, 0.5 * y * (1 - v) + b * v, z + 0 * u]

        points, faces = patch(place, around + 1, count)
        return points, faces[:, ::-1] if up else faces

    def wall(curve: Callable[[np.ndarray], Arrays], scale: float, inside: bool) -> Arrays:
        def place(u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
            x, y = curve(u)
            return [scale * x, scale * y, v * 0.8]

        points, faces = patch(place, around + 1, count)
        return points, faces[:, ::-1] if inside else faces

    return welded(ring(0.8, True), ring(0.0, False), wall(square, 1.0, False), wall(turn, 0.5, True))
