from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC
from helpers import DOUBLE, cube

from torchfair import Topology, TorchfairError
from torchfair.geometry import (
    corrected_shape_operators,
    shape_operators,
    star_normals,
    tangent_bases,
    tangential_shape_operators,
)

ESTIMATORS = {
    "sine": {"estimator": "normal_cycle", "sine": True},
    "angle": {"estimator": "normal_cycle", "sine": False},
    "corrected": {"estimator": "corrected"},
}
each_estimator = pytest.mark.parametrize("choice", ESTIMATORS.values(), ids=ESTIMATORS.keys())


@each_estimator
@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_symmetric_part_in_the_tangent_plane(choice, mesh):
    """Turned back into space: P (W + W^T)/2 P with the projection P along the sum of the normals."""
    vertices, topology = mesh()
    normals = star_normals(vertices, topology)
    bases = tangent_bases(normals)
    if choice["estimator"] == "corrected":
        operators = corrected_shape_operators(vertices, topology)
    else:
        operators = shape_operators(vertices, topology, sine=choice["sine"])
    along = torch.eye(3, dtype=DOUBLE) - normals[:, :, None] * normals[:, None, :]
    found = tangential_shape_operators(vertices, topology, **choice)
    torch.testing.assert_close(found, found.mT, rtol=0, atol=0)
    torch.testing.assert_close(bases.mT @ found @ bases, along @ (operators + operators.mT) / 2 @ along)


@pytest.mark.parametrize("sine", [True, False])
def test_a_cube_corner_keeps_two_of_its_three_eigenvalues(sine):
    strength = 0.5 if sine else math.pi / 4  # the 3x3 operators are multiples of the identity
    expected = strength * torch.eye(2, dtype=DOUBLE).expand(8, 2, 2)
    torch.testing.assert_close(tangential_shape_operators(*cube(), sine=sine), expected)


@each_estimator
@pytest.mark.parametrize("mesh", DEGENERATE.values(), ids=DEGENERATE.keys())
def test_finite_with_gradients_on_degenerate_meshes(choice, mesh):
    vertices, topology = mesh()
    variable = vertices.clone().requires_grad_()
    value = tangential_shape_operators(variable, topology, **choice)
    (gradient,) = torch.autograd.grad(value.sum(), variable)
    assert value.isfinite().all()
    assert gradient.isfinite().all()


@each_estimator
def test_zero_where_normals_cancel(choice):
    """Two triangles back to back: every star is folded flat and has no normal."""
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=DOUBLE)
    assert not tangential_shape_operators(vertices, Topology.from_faces([[0, 1, 2], [0, 2, 1]]), **choice).any()


def test_unknown_estimators_are_named():
    with pytest.raises(TorchfairError, match='must be "normal_cycle" or "corrected", got \'cotangent\''):
        tangential_shape_operators(*cube(), estimator="cotangent")
