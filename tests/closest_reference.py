"""Slow exact references and surfaces for the tests of closest points."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair import Topology
from torchfair.geometry.closest_point import ClosestPoints, ReferenceSurface


def exact_squared_distance(point: list[float], corners: list[list[float]]) -> Fraction:
    """Squared distance of a point to a triangle in rational arithmetic, without any rounding."""
    p, a, b, c = (fractions(x) for x in (point, *corners))
    found = []
    for start, end in ((a, b), (b, c), (c, a)):
        edge, offset = subtract(end, start), subtract(p, start)
        length = dot(edge, edge)
        t = min(max(dot(offset, edge) / length, Fraction(0)), Fraction(1)) if length else Fraction(0)
        rest = subtract(offset, [t * x for x in edge])
        found.append(dot(rest, rest))
    normal = cross(subtract(b, a), subtract(c, a))
    sides = [dot(cross(normal, subtract(end, start)), subtract(p, start)) for start, end in ((a, b), (b, c), (c, a))]
    if any(normal) and min(sides) >= 0:
        found.append(dot(subtract(p, a), normal) ** 2 / dot(normal, normal))
    return min(found)


Exact = list[Fraction]


def fractions(values: list[float]) -> Exact:
    return [Fraction(x) for x in values]


def subtract(u: Exact, v: Exact) -> Exact:
    return [x - y for x, y in zip(u, v, strict=True)]


def dot(u: Exact, v: Exact) -> Fraction:
    return sum((x * y for x, y in zip(u, v, strict=True)), Fraction(0))


def cross(u: Exact, v: Exact) -> Exact:
    return [u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3)]


def soup(triangles: Tensor) -> ReferenceSurface:
    """Unconnected triangles (T, 3, 3) as a surface: any positions are allowed."""
    count = triangles.shape[0]
    return ReferenceSurface(triangles.reshape(-1, 3), Topology.from_faces(np.arange(3 * count).reshape(-1, 3)))


def measure_every_piece(surface: ReferenceSurface, points: Tensor) -> tuple[Tensor, Tensor]:
    """Smallest computed distance over all pieces, and the lowest piece that attains it."""
    columns = np.ascontiguousarray(points.numpy().T)
    count = surface.pieces.shape[0]
    shape = surface._triangles
    rows = [shape.squared_distances(columns, np.full(points.shape[0], piece)) for piece in range(count)]
    squared = np.stack(rows)
    return torch.from_numpy(np.sqrt(squared.min(0))), torch.from_numpy(squared.argmin(0))


def same(a: ClosestPoints, b: ClosestPoints) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def ridge() -> tuple[Tensor, Topology]:
    """Mixed polygons: a pentagon, a skew quad, a triangle, and an isolated vertex at the end."""
    vertices = [
        [0.0, 0, 0],
        [2, 0, 0.3],
        [3, 2, 0],
        [1, 3, -0.2],
        [-1, 2, 0.1],
        [4, 0, 1],
        [5, 2, 0],
        [2, 4, 1],
        [9, 9, 9],
    ]
    faces = [[0, 1, 2, 3, 4], [1, 5, 6, 2], [3, 2, 7]]
    return torch.tensor(vertices, dtype=DOUBLE), Topology.from_faces(faces, 9)
