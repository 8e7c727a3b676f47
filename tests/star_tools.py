"""Single stars, random ones, and an obvious, slow judgement of them by trying very many planes."""

from __future__ import annotations

import math

import numpy as np
import torch
from helpers import DOUBLE

from torchfair import Topology

Star = tuple[torch.Tensor, Topology]


def star_of(arms: object) -> Star:
    """One inner vertex, number 0 in the origin, with the given arms counterclockwise seen from above."""
    ring = torch.as_tensor(np.asarray(arms, float), dtype=DOUBLE)
    count = len(ring)
    faces = [[0, 1 + i, 1 + (i + 1) % count] for i in range(count)]
    return torch.cat([torch.zeros(1, 3, dtype=DOUBLE), ring]), Topology.from_faces(faces)


def stars_of(arms: np.ndarray) -> Star:
    """Many stars ``(n, k, 3)`` as one mesh of separate pieces; the centres are vertices 0, k+1, 2(k+1), ..."""
    count, size, _ = arms.shape
    points = np.concatenate([np.zeros((count, 1, 3)), arms], axis=1).reshape(-1, 3)
    first = np.arange(size)
    faces = np.stack([np.zeros(size, int), 1 + first, 1 + (first + 1) % size], axis=1)
    numbers = (faces[None] + (size + 1) * np.arange(count)[:, None, None]).reshape(-1, 3)
    return torch.from_numpy(points), Topology.from_faces(numbers)


def random_arms(count: int, size: int, seed: int, *, height: float = 0.3, saddle: float = 0.0) -> np.ndarray:
    """Arms around the z axis at random angles (neighbours less than 180 degrees apart), random lengths and heights.

    ``saddle`` adds the heights of ``saddle * (x^2 - y^2)``.
    """
    random = np.random.default_rng(seed)
    steps = random.uniform(0.35, 1.0, (count, size))
    angles = 2 * math.pi * np.cumsum(steps, axis=1) / steps.sum(1, keepdims=True) + random.uniform(0, 7, (count, 1))
    lengths = random.uniform(0.6, 1.4, (count, size))
    x, y = lengths * np.cos(angles), lengths * np.sin(angles)
    z = height * random.normal(size=(count, size)) + saddle * (x**2 - y**2)
    return np.stack([x, y, z], axis=-1)


def directions(count: int) -> np.ndarray:
    """Evenly spread directions (Fibonacci lattice) on the whole sphere."""
    i = np.arange(count) + 0.5
    z = 1 - 2 * i / count
    turn = math.pi * (1 + math.sqrt(5)) * i
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def has_witness(arms: np.ndarray, normals: np.ndarray, *, rounding: float = 0.0) -> bool:
    """Whether one of the planes with normals ``(m, 3)`` shows a star ``(k, 3)`` to be a saddle, by the definition.

    Works in the planes: the star is projected, and the directions of the segments are measured as angles. Segments
    are in a half-plane if they leave a gap of half a turn, and ``rounding``.
    """
    following = np.roll(arms, -1, axis=0)
    admissible = normals[(normals @ np.cross(arms, following).T > 0).all(1)]
    heights = admissible @ arms.T
    crossed = heights * np.roll(heights, -1, axis=1) < 0
    chosen = crossed.sum(1) == 4
    planes, z, crossed = admissible[chosen], heights[chosen], crossed[chosen]
    if not len(planes):
        return False
    angles = _angles(arms[None], planes)
    steps = (np.roll(angles, -1, axis=1) - angles) % (2 * math.pi)
    one_to_one = (steps < math.pi).all(1) & (np.rint(steps.sum(1) / (2 * math.pi)) == 1)
    plane, sector = np.nonzero(crossed)
    start, stop = z[plane, sector], z[plane, (sector + 1) % len(arms)]
    t = (start / (start - stop))[:, None]
    segments = ((1 - t) * arms[sector] + t * following[sector]).reshape(-1, 4, 3)
    turns = np.sort(_angles(segments, planes), axis=1)
    gaps = np.diff(np.concatenate([turns, turns[:, :1] + 2 * math.pi], axis=1), axis=1)
    return bool((one_to_one & (gaps.max(1) < math.pi + rounding)).any())


def _angles(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Polar angles (m, n) of points ``(m, n, 3)`` projected along unit normals (m, 3)."""
    right = np.cross(np.eye(3)[np.abs(normals).argmin(1)], normals)
    up = np.cross(normals, right)  # as long as the other one
    return np.arctan2((points * up[:, None]).sum(-1), (points * right[:, None]).sum(-1))
