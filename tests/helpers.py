"""Small meshes and tools that several tests share."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology

DOUBLE = torch.float64


def tetrahedron() -> tuple[Tensor, Topology]:
    """Regular tetrahedron of edge 2 sqrt 2, faces outward."""
    vertices = torch.tensor([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=DOUBLE)
    return vertices, Topology.from_faces([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def cube() -> tuple[Tensor, Topology]:
    """Unit cube with six square faces, outward."""
    vertices = torch.tensor([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)], dtype=DOUBLE)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return vertices, Topology.from_faces(faces)


def split_quads(faces: np.ndarray) -> np.ndarray:
    """Two triangles (0, 1, 2) and (0, 2, 3) for each quad."""
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """Quads of a grid of ``rows x columns`` vertices, numbered row by row."""
    index = np.arange(rows * columns).reshape(rows, columns)
    corners = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
    return np.stack([corner.ravel() for corner in corners], axis=1)


def wavy_grid(rows: int = 6, columns: int = 5, *, triangles: bool = False, seed: int = 0) -> tuple[Tensor, Topology]:
    """A perturbed height field over a grid: generic position, with boundary."""
    faces = grid_faces(rows, columns)
    topology = Topology.from_faces(split_quads(faces) if triangles else faces)
    x, y = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.zeros(rows * columns)], axis=1)
    points = points + np.random.default_rng(seed).uniform(-0.3, 0.3, points.shape)
    return torch.from_numpy(points), topology


def random_rotation(seed: int = 0) -> Tensor:
    """A proper rotation matrix."""
    matrix = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return torch.from_numpy(matrix * np.sign(np.linalg.det(matrix)))


def report_in(folder: Path) -> dict[str, Any]:
    """The report of the one output whose report is in a folder."""
    (path,) = folder.glob("*.report.json")
    return dict(json.loads(path.read_text()))
