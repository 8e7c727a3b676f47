"""Clean meshes, and noise on them."""

from __future__ import annotations

import numpy as np
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import edge_lengths, face_normals, vertex_normals

Mesh = tuple[Tensor, Topology]


def box(n: int = 10) -> Mesh:
    """The surface of a unit cube, n x n squares a side, cut by either diagonal at random."""
    line = np.arange(n + 1)
    place: dict[tuple[int, ...], int] = {}
    faces = []
    random = np.random.default_rng(0)
    for axis in range(3):
        for side in (0, n):
            for i in line[:-1]:
                for j in line[:-1]:
                    corners = []
                    for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                        point = [0, 0, 0]
                        point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3] = side, int(a), int(b)
                        corners.append(place.setdefault(tuple(point), len(place)))
                    corners = corners if side else corners[::-1]
                    corners = corners[1:] + corners[:1] if random.random() < 0.5 else corners
                    faces += [corners[:3], [corners[0], *corners[2:]]]
    return torch.tensor(list(place), dtype=DOUBLE) / n, Topology.from_faces(faces)


def noisy(mesh: Mesh, kind: str, level: float, seed: int = 0) -> Tensor:
    """Vertices with Gaussian noise of ``level`` mean edges, along normals or in each of three directions."""
    vertices, topology = mesh
    random = torch.Generator().manual_seed(seed)
    size = level * float(edge_lengths(vertices, topology).mean())
    if kind == "all":
        return vertices + size * torch.randn(len(vertices), 3, generator=random, dtype=DOUBLE)
    return vertices + size * torch.randn(len(vertices), 1, generator=random, dtype=DOUBLE) * vertex_normals(*mesh)


def angles(vertices: Tensor, clean: Mesh) -> Tensor:
    """(F,) degrees between normals of faces and those of the clean mesh."""
    cosine = (face_normals(vertices, clean[1]) * face_normals(*clean)).sum(1)
    return torch.rad2deg(torch.acos(cosine.clamp(-1.0, 1.0)))
