"""References of jobs and closeness: meshes and functions through one door, checked."""

from __future__ import annotations

import copy
import pickle

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import MeshError, ShapeError
from torchfair.constraints import Closeness, TangentPlanes
from torchfair.geometry import ReferenceSurface, closest_on
from torchfair.shapes import ClosestOnSurface, Sphere, icosphere


def unit_sphere(points: Tensor) -> tuple[Tensor, Tensor]:
    normals = points / torch.linalg.vector_norm(points, dim=1, keepdim=True)
    return normals, normals


def test_a_mesh_answers_as_its_own_search_does() -> None:
    vertices, topology = wavy_grid()
    surface = ReferenceSurface(vertices, topology)
    points = vertices + 0.2
    positions, normals = closest_on(surface)(points)
    closest = surface.closest(points)
    assert torch.equal(positions, closest.positions)
    assert torch.equal(normals, closest.smooth_normals)


@pytest.mark.parametrize("sphere", [unit_sphere, ClosestOnSurface(Sphere(1.0))])
def test_closeness_to_a_smooth_sphere_is_half_the_squared_distance(sphere: object) -> None:
    points = torch.randn(20, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    module = Closeness(sphere, torch.arange(20))  # type: ignore[arg-type]
    radii = torch.linalg.vector_norm(points, dim=1, keepdim=True)
    value = module(points)
    torch.testing.assert_close(value, 0.5 * (radii - 1.0).square().sum())
    variable = points.clone().requires_grad_()
    module(variable).backward()
    torch.testing.assert_close(variable.grad, (1.0 - 1.0 / radii) * points)
    for other in (copy.deepcopy(module), pickle.loads(pickle.dumps(module))):
        torch.testing.assert_close(other(points), value)


def test_normals_of_planes_point_to_one_side_however_the_reference_turns_them() -> None:
    outside = icosphere(1).vertices * torch.tensor([1.2, 0.9, 1.0], dtype=DOUBLE)
    planes = TangentPlanes(unit_sphere)({"vertices": outside})
    turned = TangentPlanes(lambda points: (unit_sphere(points)[0], -unit_sphere(points)[1]))({"vertices": outside})
    torch.testing.assert_close(planes[0], turned[0])
    torch.testing.assert_close(planes[1], -turned[1])


@pytest.mark.parametrize(
    ("reference", "error", "words"),
    [
        (3.0, ShapeError, "reference: expected a ReferenceSurface, or a function"),
        (lambda points: points, ShapeError, "two tensors"),
        (lambda points: (points[:1], points), ShapeError, "positions of reference"),
        (lambda points: (points, points[:, :2]), ShapeError, "normals of reference"),
        (lambda points: (points, points / 0.0), MeshError, r"normals that are not finite for 2 points, first \[0, 1\]"),
    ],
)
def test_functions_that_are_none_are_refused(reference: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        closest_on(reference)(torch.ones(2, 3, dtype=DOUBLE))  # type: ignore[arg-type]


def test_what_functions_depend_on_carries_no_graph() -> None:
    radius = torch.tensor(2.0, dtype=DOUBLE, requires_grad=True)
    positions, normals = closest_on(lambda points: (radius * unit_sphere(points)[0], unit_sphere(points)[1]))(
        torch.ones(2, 3, dtype=DOUBLE, requires_grad=True)
    )
    assert not positions.requires_grad
    assert not normals.requires_grad
    torch.testing.assert_close(torch.linalg.vector_norm(positions, dim=1), torch.full((2,), 2.0, dtype=DOUBLE))
