"""One point is looked for without copies of tables that grow with the shape."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair.geometry import ReferenceSurface
from torchfair.geometry.closest_curve_point import ReferenceCurves

POINT = torch.tensor([[0.3, 0.2, 0.1]], dtype=DOUBLE)


def taken(search: Callable[[], object]) -> int:
    """Bytes that NumPy has at once while it searches."""
    search()  # what is made once is made
    tracemalloc.start()
    try:
        search()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def on_a_mesh() -> tuple[Callable[[], object], int]:
    surface = ReferenceSurface(*wavy_grid(90, 90))
    return lambda: surface.closest(POINT), len(surface.pieces)


def on_a_curve() -> tuple[Callable[[], object], int]:
    place = torch.linspace(0.0, 1.0, 20_000, dtype=DOUBLE)[:, None]
    curves = ReferenceCurves([torch.cat([place, place**2, place**3], 1)], [False])
    return lambda: curves.closest(POINT, torch.zeros(1, dtype=torch.int64)), len(place)


@pytest.mark.parametrize("shape", [on_a_mesh, on_a_curve])
def test_a_search_for_one_point_copies_no_table(shape: Callable[[], tuple[Callable[[], object], int]]) -> None:
    search, pieces = shape()
    assert taken(search) < 8 * pieces  # one number of each piece; the tables have 6 to 24


def test_a_surface_keeps_few_numbers_of_each_piece() -> None:
    """Corners, normals and boxes: what follows from these is worked out again; normals of points are kept once."""
    vertices, topology = wavy_grid(65, 65, triangles=True)
    surface = ReferenceSurface(vertices, topology)
    triangles, pieces = surface._triangles, len(surface.pieces)
    assert triangles._table.nbytes == 12 * 8 * pieces
    assert surface._smooth.nbytes == 3 * 8 * len(vertices)
    assert np.shares_memory(surface._corners, surface.pieces.numpy())
