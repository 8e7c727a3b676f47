from __future__ import annotations

import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC
from helpers import DOUBLE, cube

from torchfair.geometry import face_areas, vertex_areas


@pytest.mark.parametrize("mesh", [*GENERIC.values(), *DEGENERATE.values()], ids=[*GENERIC, *DEGENERATE])
def test_sum_to_the_total_area(mesh):
    vertices, topology = mesh()
    torch.testing.assert_close(vertex_areas(vertices, topology).sum(), face_areas(vertices, topology).sum())


def test_cube_corners_have_a_quarter_of_three_faces():
    torch.testing.assert_close(vertex_areas(*cube()), torch.full((8,), 0.75, dtype=DOUBLE))
