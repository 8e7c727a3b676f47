"""Centres of faces: means of corners, in every batch and for polygons of any size."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import mixed_grid
from helpers import DOUBLE, wavy_grid

from torchfair import ShapeError
from torchfair.geometry import face_centres


def test_means_of_corners_of_any_polygons() -> None:
    vertices, topology = mixed_grid()
    expected = torch.stack([vertices[list(face)].mean(0) for face in topology.face_lists()])
    assert len({len(face) for face in topology.face_lists()}) > 1
    assert torch.allclose(face_centres(vertices, topology), expected)
    batch = torch.stack([vertices, 3 * vertices - 1])[None]
    assert torch.allclose(face_centres(batch, topology)[0, 1], 3 * expected - 1)
    assert torch.allclose(torch.vmap(lambda v: face_centres(v, topology))(batch[0]), face_centres(batch[0], topology))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_precision_and_derivatives(dtype: torch.dtype) -> None:
    vertices, topology = wavy_grid(3, 3)
    assert face_centres(vertices.to(dtype), topology).dtype == dtype
    if dtype == DOUBLE:
        assert torch.autograd.gradcheck(lambda v: face_centres(v, topology), vertices.clone().requires_grad_())


def test_wrong_vertices_are_named() -> None:
    with pytest.raises(ShapeError, match="vertices"):
        face_centres(torch.zeros(3, 2), wavy_grid(3, 3)[1])
