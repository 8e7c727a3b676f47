"""The mesh of the benchmark of sizes: a torus with bumps, its vertices shaken, its diagonals irregular."""

from __future__ import annotations

import numpy as np

_MAJOR, _MINOR = 3.0, 1.0
_SHAKE = 0.25  # of a cell, at most, in both directions
_BUMPS = (7, 5, 0.06)  # waves around the axis, waves around the tube, height


def bumpy_torus(size: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and triangles (F, 3).

    Vertices are those of a grid on the torus, moved at random by up to a quarter of a cell; every quad is cut by its
    shorter diagonal, so that vertices have 4 to 8 neighbours. Bumps are a hundredth of the size of the torus high.

    Args:
        size: Wanted number of vertices; the grid takes the nearest one with nearly square cells.
        seed: Of the random moves.
    """
    minor = max(3, round((size * _MINOR / _MAJOR) ** 0.5))
    major = max(3, round(size / minor))
    random = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(major), np.arange(minor), indexing="ij")
    u = 2 * np.pi * (i + random.uniform(-_SHAKE, _SHAKE, i.shape)) / major
    v = 2 * np.pi * (j + random.uniform(-_SHAKE, _SHAKE, j.shape)) / minor
    around, across, height = _BUMPS
    radius = _MINOR + height * np.sin(around * u) * np.cos(across * v)
    distance = _MAJOR + radius * np.cos(v)
    points = np.stack([distance * np.cos(u), distance * np.sin(u), radius * np.sin(v)], -1).reshape(-1, 3)
    here, right, up, far = (
        ((i + p) % major * minor + (j + q) % minor).ravel() for p, q in ((0, 0), (1, 0), (0, 1), (1, 1))
    )
    straight = np.linalg.norm(points[here] - points[far], axis=1) <= np.linalg.norm(points[right] - points[up], axis=1)
    first = np.where(straight[:, None], np.stack([here, right, far], 1), np.stack([here, right, up], 1))
    second = np.where(straight[:, None], np.stack([here, far, up], 1), np.stack([right, far, up], 1))
    return points, np.concatenate([first, second])
