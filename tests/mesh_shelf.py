"""Face lists of small meshes of every kind."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from helpers import cube, grid_faces, split_quads, tetrahedron

from torchfair import Topology

HYBRID = [[0, 1, 2], [0, 2, 3], [2, 1, 4, 5], [3, 2, 5, 6, 7]]  # two triangles, a quad, a pentagon


def torus_faces(rows: int, columns: int) -> np.ndarray:
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    corners = [(i + a) % rows * columns + (j + b) % columns for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return np.stack([corner.ravel() for corner in corners], axis=1)


def fan_faces(size: int) -> np.ndarray:
    """Triangles around vertex 0, open."""
    rim = np.arange(1, size + 1)
    return np.stack([np.zeros(size, int), rim, rim + 1], axis=1)


SHELF = {
    "tetrahedron": tetrahedron()[1].face_lists(),
    "cube": cube()[1].face_lists(),
    "triangle": [[0, 1, 2]],
    "pillow": [[0, 1, 2], [0, 2, 1]],
    "quad grid": grid_faces(4, 5).tolist(),
    "triangle grid": split_quads(grid_faces(5, 4)).tolist(),
    "hybrid": HYBRID,
    "torus": torus_faces(4, 5).tolist(),
    "fan": fan_faces(7).tolist(),
    "two parts, a gap in the numbers": [[0, 1, 2], [5, 6, 7, 8], [6, 5, 9]],
    "annulus": [face for face in grid_faces(4, 4).tolist() if face != [5, 9, 10, 6]],
}
each_mesh = pytest.mark.parametrize("faces", SHELF.values(), ids=SHELF)


def same(a: Topology, b: Topology) -> bool:
    """Whether two topologies hold equal tensors."""
    names = [name for name in vars(a) if isinstance(getattr(a, name), torch.Tensor)]
    return a.num_vertices == b.num_vertices and all(torch.equal(getattr(a, n), getattr(b, n)) for n in names)
