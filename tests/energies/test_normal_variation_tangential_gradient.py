"""Ideal case I of the paper: on meshes along smooth curves of a surface the gradient of E becomes orthogonal to it."""

from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import GENERIC
from helpers import DOUBLE, random_rotation, wavy_grid

from torchfair import ShapeError, Topology
from torchfair.energies import normal_variation, normal_variation_tangential_gradient
from torchfair.geometry import vertex_normals
from torchfair.measuring import measure_stationarity
from torchfair.shapes import (
    Catenoid,
    ClosestOnSurface,
    Enneper,
    Torus,
    irregular_triangles,
    principal_quads,
    principal_triangles,
    rotated_lattice,
)

SURFACES = {"torus": Torus(2.0, 0.8), "enneper": Enneper(), "catenoid": Catenoid()}
each_surface = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES.keys())


def imbalance(mesh) -> float:
    return measure_stationarity(mesh.vertices, mesh.topology, lambda points: (points, mesh.normals)).imbalance


@each_surface
@pytest.mark.parametrize(
    ("make", "least_order", "most"),
    [
        (principal_quads, 2.5, 6e-4),
        (principal_triangles, 0.8, 1e-2),
        (lambda *size: rotated_lattice(*size, 0.3), 0.9, 0.06),
    ],
    ids=["principal quads", "principal triangles", "turned lattice"],
)
def test_ideal_case_one_nets_of_smooth_curves_become_stationary(surface, make, least_order, most):
    coarse, fine = (imbalance(make(surface, n, 2 * n)) for n in (12, 24))
    assert fine < most
    assert math.log2(coarse / fine) > least_order


@each_surface
def test_irregular_meshes_do_not(surface):
    for count in (300, 1200):
        assert 0.4 < imbalance(irregular_triangles(surface, count)) < 0.8


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_is_the_projected_gradient_and_orthogonal_to_the_normals(mesh):
    vertices, topology = mesh()
    normals = vertex_normals(vertices, topology)
    part = normal_variation_tangential_gradient(vertices, normals, topology)
    gradient = torch.func.grad(lambda v: normal_variation(v, topology))(vertices)
    assert (part * normals).sum(-1).abs().max() < 1e-13
    assert torch.linalg.cross(gradient - part, normals).abs().max() < 1e-13


def test_descends_along_the_surface_at_the_rate_of_its_square():
    """Moving every vertex of a sphere against it lowers E by |t|^2 per unit of the step."""
    mesh = irregular_triangles(Torus(2.0, 0.8), 200)
    part = normal_variation_tangential_gradient(mesh.vertices, mesh.normals, mesh.topology)
    step = 1e-7
    moved, _ = ClosestOnSurface(mesh.surface)(mesh.vertices - step * part)
    rate = (normal_variation(mesh.vertices, mesh.topology) - normal_variation(moved, mesh.topology)) / step
    assert rate.item() == pytest.approx(part.square().sum().item(), rel=1e-4)


def test_batches_weights_scale_and_rotation():
    vertices, topology = wavy_grid(5, 5, triangles=True)
    normals = vertex_normals(vertices, topology)
    part = normal_variation_tangential_gradient(vertices, normals, topology)
    batch = torch.stack([vertices, 3.0 * vertices])
    torch.testing.assert_close(
        normal_variation_tangential_gradient(batch, normals, topology), torch.stack([part, part])
    )
    weights = torch.full((topology.num_interior_edges,), 2.0, dtype=DOUBLE)
    torch.testing.assert_close(normal_variation_tangential_gradient(vertices, normals, topology, weights), 2 * part)
    turn = random_rotation(3).T
    torch.testing.assert_close(
        normal_variation_tangential_gradient(vertices @ turn, normals @ turn, topology), part @ turn
    )
    zero = normal_variation_tangential_gradient(vertices, torch.zeros_like(normals), topology)
    torch.testing.assert_close(zero, torch.func.grad(lambda v: normal_variation(v, topology))(vertices))


def test_gradcheck_and_vmap():
    vertices, topology = wavy_grid(4, 4, triangles=True)
    normals = vertex_normals(vertices, topology)
    variable = vertices.clone().requires_grad_()
    assert torch.autograd.gradcheck(
        lambda v: normal_variation_tangential_gradient(v, normals, topology), variable, fast_mode=True
    )
    batch = torch.stack([vertices, vertices.roll(1, 1)])
    mapped = torch.func.vmap(lambda v: normal_variation_tangential_gradient(v, normals, topology))(batch)
    torch.testing.assert_close(mapped, normal_variation_tangential_gradient(batch, normals, topology))


def test_whatever_follows_the_vertices_sees_the_same():
    """Gradients of plain tensors take another way than those that something follows."""
    vertices, topology = wavy_grid(4, 4, triangles=True)
    normals, motion = vertex_normals(vertices, topology), vertices.sin()
    weights = torch.linspace(0.5, 2.0, topology.num_interior_edges, dtype=DOUBLE)

    def function(points: torch.Tensor) -> torch.Tensor:
        return normal_variation_tangential_gradient(points, normals, topology, weights)

    part = function(vertices)
    for around in (torch.no_grad, torch.inference_mode):
        with around():
            torch.testing.assert_close(function(vertices), part)
    assert not part.requires_grad
    with torch.autograd.forward_ad.dual_level():
        dual = torch.autograd.forward_ad.unpack_dual(function(torch.autograd.forward_ad.make_dual(vertices, motion)))
    step = 1e-6
    rate = (function(vertices + step * motion) - function(vertices - step * motion)) / (2 * step)
    torch.testing.assert_close(dual.tangent, rate, rtol=1e-6, atol=1e-7)
    torch.testing.assert_close(torch.func.jvp(function, (vertices,), (motion,))[1], dual.tangent)
    weights.requires_grad_()
    function(vertices).square().sum().backward()
    torch.testing.assert_close((weights.grad * weights).sum(), 2 * part.square().sum())  # of degree 2 in the weights


def test_flat_meshes_are_stationary():
    vertices, topology = wavy_grid(5, 5, triangles=True)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE).expand_as(flat)
    assert not normal_variation_tangential_gradient(flat, up, topology).any()


@pytest.mark.parametrize("normals", [torch.ones(3, 3), torch.ones(9, 3, dtype=torch.int64), [1.0]])
def test_refuses_other_normals(normals):
    vertices, topology = wavy_grid(3, 3)
    with pytest.raises(ShapeError, match="normals"):
        normal_variation_tangential_gradient(vertices, normals, topology)
    with pytest.raises(ShapeError, match="vertices"):
        normal_variation_tangential_gradient(vertices[:4], vertices, Topology.from_faces(topology.face_lists()))
