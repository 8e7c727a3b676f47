"""Triangles between the points of rims alone: those of least area, by dynamic programming."""

from __future__ import annotations

import numpy as np

from .patch import Floats, Ints

_EVEN = 0.02  # weight of squared edge lengths beside the area: of triangles without area the shorter ones are taken
_STARTS = 6  # edges between two rims that are tried as the first one


def least_area_disk(points: Floats) -> Ints:
    """(n - 2, 3) triangles that span a closed polygon (n, 3) in space: Barequet and Sharir (1995), O(n^3)."""
    count = len(points)
    cost, choice = np.zeros((count, count)), np.zeros((count, count), np.int64)
    for gap in range(2, count):
        i = np.arange(count - gap)
        k = i[:, None] + np.arange(1, gap)
        j = np.broadcast_to(i[:, None] + gap, k.shape)
        rows = np.broadcast_to(i[:, None], k.shape)
        total = cost[rows, k] + cost[k, j] + _weights(points[rows], points[k], points[j])
        best = total.argmin(1)
        cost[i, i + gap], choice[i, i + gap] = total[i, best], k[i, best]
    faces, stack = [], [(0, count - 1)]
    while stack:
        start, end = stack.pop()
        if end - start > 1:
            tip = int(choice[start, end])
            faces.append((start, tip, end))
            stack += [(start, tip), (tip, end)]
    return np.array(faces)


def least_area_band(first: Floats, second: Floats) -> tuple[Ints, float]:
    """(n + m, 3) triangles between two closed polygons (n, 3) and (m, 3) that run the same way, and their cost.

    Every triangle has an edge of one polygon and a vertex of the other: a shortest way through a grid that closes up
    in both directions (Fuchs, Kedem and Uselton 1977).
    """
    gaps = np.linalg.norm(first[:, None] - second[None], axis=2)
    starts = np.argsort(gaps.min(1), kind="stable")
    starts = starts[:: max(1, len(starts) // _STARTS)]
    found = [_band(first, second, int(i), int(gaps[i].argmin())) for i in starts]
    return min(found, key=lambda one: one[1])


def _band(first: Floats, second: Floats, i0: int, j0: int) -> tuple[Ints, float]:
    n, m = len(first), len(second)
    a = np.concatenate([np.roll(first, -i0, axis=0), first[i0 : i0 + 1]])
    b = np.concatenate([np.roll(second, -j0, axis=0), second[j0 : j0 + 1]])
    along_a = _weights(a[:-1, None], a[1:, None], b[None])  # (n, m + 1) of the triangle a_i, a_(i+1), b_j
    along_b = _weights(a[:, None], b[None, :-1], b[None, 1:])  # (n + 1, m)
    cost = np.full((n + 1, m + 1), np.inf)
    cost[0, 0] = 0.0
    from_a = np.zeros((n + 1, m + 1), bool)
    for step in range(1, n + m + 1):
        i = np.arange(max(0, step - m), min(n, step) + 1)
        j = step - i
        # The first step is along the first polygon, and not all of them are: then no edge comes twice.
        by_a = np.where((i > 0) & ((i < n) | (j > 0)), cost[i - 1, j] + along_a[i - 1, j], np.inf)
        by_b = np.where((j > 0) & (i > 0), cost[i, j - 1] + along_b[i, j - 1], np.inf)
        cost[i, j], from_a[i, j] = np.minimum(by_a, by_b), by_a < by_b
    faces, row, column = [], n, m
    while row or column:
        here = ((row + i0) % n, n + (column + j0) % m)
        if from_a[row, column]:
            row -= 1
            faces.append(((row + i0) % n, here[0], here[1]))
        else:
            column -= 1
            faces.append((here[0], here[1], n + (column + j0) % m))
    return np.array(faces), float(cost[n, m])


def _weights(a: Floats, b: Floats, c: Floats) -> Floats:
    u, v, w = b - a, c - a, c - b
    area = 0.5 * np.linalg.norm(np.cross(u, v), axis=-1)
    weights: Floats = area + _EVEN * sum((x * x).sum(-1) for x in (u, v, w))
    return weights
