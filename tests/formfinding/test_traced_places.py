"""Closest points as functions of a reference mesh, and gliding vertices as functions of where they are."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.constraints import TangentPlanes
from torchfair.formfinding.differentiable.placing import placed
from torchfair.formfinding.differentiable.traced_planes import TracedPlanes
from torchfair.geometry import ReferenceSurface


def points_around(vertices: Tensor, count: int = 40) -> Tensor:
    generator = torch.Generator().manual_seed(3)
    low, high = vertices.amin(0) - 0.3, vertices.amax(0) + 0.3
    return low + (high - low) * torch.rand(count, 3, generator=generator, dtype=DOUBLE)


@pytest.mark.parametrize("triangles", [True, False])
def test_planes_follow_the_reference(triangles: bool) -> None:
    """Over faces, edges and vertices, of triangles and of fans: values those of the search, derivatives differences."""
    vertices, topology = wavy_grid(5, 5, triangles=triangles)
    points = points_around(vertices)
    traced = vertices.clone().requires_grad_()
    surface = ReferenceSurface(vertices, topology)
    feet, normals = TracedPlanes(surface, traced)({"vertices": points})
    for found, expected in zip((feet, normals), TangentPlanes(surface)({"vertices": points}), strict=True):
        torch.testing.assert_close(found, expected, rtol=0.0, atol=1e-12)
    active = (surface.closest(points).weights > 1e-12).sum(1)
    assert active.bincount(minlength=4)[1:].all()  # each kind of place is there
    way = torch.linspace(0.0, 9.0, vertices.numel(), dtype=DOUBLE).sin().view_as(vertices)
    step, sides = 1e-6, []
    for sign in (1.0, -1.0):
        moved = ReferenceSurface(vertices + sign * step * way, topology)
        sides.append(TangentPlanes(moved)({"vertices": points}))
    for number, found in enumerate((feet, normals)):
        expected = (sides[0][number] - sides[1][number]) / (2.0 * step)
        slopes = [
            [(torch.autograd.grad(found[i, j], traced, retain_graph=True)[0] * way).sum() for j in range(3)]
            for i in range(len(points))
        ]
        torch.testing.assert_close(torch.tensor(slopes, dtype=DOUBLE), expected, rtol=1e-5, atol=1e-6)


def test_on_the_surface_normals_are_those_of_the_mesh() -> None:
    vertices, topology = wavy_grid(4, 4)
    surface = ReferenceSurface(vertices, topology)
    feet, normals = TracedPlanes(surface, vertices)({"vertices": vertices})
    torch.testing.assert_close(feet, vertices, rtol=0.0, atol=0.0)
    torch.testing.assert_close(normals, TangentPlanes(surface)({"vertices": vertices})[1], rtol=0.0, atol=0.0)


def on_circle(points: Tensor) -> Tensor:
    """Closest points of the unit circle about the z axis."""
    flat = points[:, :2]
    return torch.cat([flat / flat.norm(dim=1, keepdim=True), torch.zeros_like(points[:, 2:])], dim=1)


def test_gliding_vertices_are_differentiated_as_closest_points() -> None:
    """Of a circle the derivative is known; inside it, where feet travel farther than vertices, and outside."""
    points = torch.tensor([[0.5, 0.1, 0.3], [1.4, -0.7, 0.0], [-1.0, 0.2, -0.4]], dtype=DOUBLE, requires_grad=True)
    cotangent = torch.tensor([[1.0, 2.0, 3.0], [0.5, -1.0, 2.0], [0.0, 1.0, 0.0]], dtype=DOUBLE)
    (slope,) = torch.autograd.grad(placed(on_circle, points), points, cotangent)
    flat = points.detach()[:, :2]
    radius = flat.norm(dim=1, keepdim=True)
    tangent = torch.stack([-flat[:, 1], flat[:, 0]], dim=1) / radius
    expected = (cotangent[:, :2] * tangent).sum(1, keepdim=True) * tangent / radius
    torch.testing.assert_close(
        slope, torch.cat([expected, torch.zeros(3, 1, dtype=DOUBLE)], dim=1), rtol=0.0, atol=1e-7
    )
    nothing = torch.autograd.grad(placed(on_circle, points), points, torch.zeros_like(cotangent))
    assert not nothing[0].any()
    (slope,) = torch.autograd.grad(placed(on_circle, points).square().sum(), points, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        slope.sum().backward()
