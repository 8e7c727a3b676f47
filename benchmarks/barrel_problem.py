"""The start of form-finding benchmarks: a barrel between two circles, whose surface of least C is the cylinder."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from torchfair import Topology


def barrel(size: int, *, height: float = 2.0, bulge: float = 0.25) -> tuple[Tensor, Topology]:
    """Tube of nearly equilateral triangles with about ``size`` vertices, wider in the middle by ``bulge``."""
    columns, rows = _lattice(size, height)
    row, column = (grid.reshape(-1) for grid in _grid(rows + 1, columns))
    along, angle = row / rows, 2 * math.pi * (column + 0.5 * (row % 2)) / columns
    radius = 1.0 + bulge * 4.0 * along * (1.0 - along)
    vertices = torch.stack([radius * angle.cos(), radius * angle.sin(), height * along], dim=1).double()
    j, i = (grid.reshape(-1) for grid in _grid(rows, columns))
    here, right = j * columns + i, j * columns + (i + 1) % columns
    up, beside = here + columns, right + columns
    even = (j % 2 == 0)[:, None]
    lower = torch.where(even, torch.stack([here, right, up], 1), torch.stack([here, right, beside], 1))
    upper = torch.where(even, torch.stack([right, beside, up], 1), torch.stack([here, beside, up], 1))
    return vertices, Topology.from_faces(torch.cat([lower, upper]))


def _grid(rows: int, columns: int) -> tuple[Tensor, ...]:
    return torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")


def _lattice(size: int, height: float) -> tuple[int, int]:
    """Columns and rows of triangles: a count near ``size`` first, then their shape."""
    ideal = math.sqrt(2 * math.pi * size * math.sqrt(0.75) / height)

    def misfit(columns: int) -> float:
        rows = max(2, round(size / columns) - 1)
        shape = height / rows / (2 * math.pi / columns * math.sqrt(0.75))
        return abs((rows + 1) * columns / size - 1.0) + 0.05 * abs(math.log(shape))

    columns = min(range(max(6, int(0.8 * ideal)), int(1.25 * ideal) + 2), key=misfit)
    return columns, max(2, round(size / columns) - 1)
