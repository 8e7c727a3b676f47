"""Faces with a corner that has hardly an angle are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from torchfair.errors import MeshError
from torchfair.meshing.verification import verify_corners


def thin(degrees: float) -> np.ndarray:
    """A square, with a triangle at one side of it that has such a corner."""
    far = [1 + 1 / math.tan(math.radians(degrees)), 0.0, 0.0]
    return np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], far])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_corners_of_less_than_half_a_degree_are_refused(scale: float) -> None:
    faces = [[0, 1, 2, 3], [1, 4, 2]]
    verify_corners(scale * thin(0.51), faces)
    with pytest.raises(MeshError, match=r"corner of 0\.49 degrees"):
        verify_corners(scale * thin(0.49), faces)


@pytest.mark.parametrize("last", [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [np.nan, 0.0, 0.0]])
def test_sides_on_each_other_equal_corners_and_no_numbers_are_refused(last: list[float]) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], last])
    with pytest.raises(MeshError, match="corner of"):
        verify_corners(points, [[0, 1, 2]])
