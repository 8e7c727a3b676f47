"""Second derivatives of E, vmap, jacobians in any order, torch.compile, inference mode, other devices."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import GENERIC, mixed_grid
from helpers import DOUBLE, wavy_grid
from normal_variation_reference import every_mesh, gradient_of, plain
from torch.autograd import forward_ad

from torchfair import Topology
from torchfair.energies import NormalVariation, normal_variation


@pytest.mark.parametrize("mesh", [GENERIC["triangles"], GENERIC["mixed"]])
def test_gradcheck_in_all_modes(mesh):
    vertices, topology = mesh()
    weights = torch.linspace(0.5, 2, topology.num_interior_edges, dtype=DOUBLE)
    inputs = (vertices.clone().requires_grad_(), weights.requires_grad_())

    def energy(v, w):
        return normal_variation(v, topology, w)

    assert torch.autograd.gradcheck(energy, inputs, fast_mode=True, check_forward_ad=True, check_batched_grad=True)
    assert torch.autograd.gradgradcheck(
        energy, inputs, fast_mode=True, check_fwd_over_rev=True, check_rev_over_rev=True, check_batched_grad=True
    )


@every_mesh
def test_second_derivatives_equal_those_of_the_plain_formula(mesh):
    vertices, topology = mesh()
    direction = torch.linspace(-1, 1, vertices.numel(), dtype=DOUBLE).view_as(vertices).sin()
    products = []
    for function in (normal_variation, plain):
        variable = vertices.clone().requires_grad_()
        (gradient,) = torch.autograd.grad(function(variable, topology), variable, create_graph=True)
        (product,) = torch.autograd.grad((gradient * direction).sum(), variable)
        products.append(product)
        with forward_ad.dual_level():  # forward mode across a backward pass that keeps no graph
            dual = forward_ad.make_dual(vertices.clone().requires_grad_(), direction)
            (gradient,) = torch.autograd.grad(function(dual, topology), dual)
            products.append(forward_ad.unpack_dual(gradient).tangent)
    for product in products[1:]:
        torch.testing.assert_close(product, products[0])


@pytest.mark.parametrize("name", ["triangles", "mixed"])
def test_transforms_in_any_order_equal_those_of_the_plain_formula(name):
    vertices, topology = wavy_grid(3, 3, triangles=True) if name == "triangles" else wavy_grid(3, 3)
    func = torch.func

    def both(transform):
        return (
            transform(lambda v: normal_variation(v, topology))(vertices),
            transform(lambda v: plain(v, topology))(vertices),
        )

    transforms = [func.grad, func.jacrev, func.jacfwd, func.hessian]
    transforms += [lambda f: func.jacfwd(func.jacfwd(f)), lambda f: func.jacrev(func.jacrev(f))]
    transforms += [lambda f: func.jacrev(func.jacfwd(f)), lambda f: func.jacfwd(func.grad(f))]
    for transform in transforms:
        torch.testing.assert_close(*both(transform), rtol=1e-10, atol=1e-10)
    torch.testing.assert_close(both(func.jacrev)[0], gradient_of(normal_variation, vertices, topology))


def test_vmap_equals_batch_equals_loop():
    vertices, topology = mixed_grid()
    module = NormalVariation(topology)
    batch = torch.stack([vertices, 2 * vertices.roll(1, 1), vertices.roll(1, 0)])
    torch.testing.assert_close(torch.func.vmap(module)(batch), module(batch))
    torch.testing.assert_close(torch.func.vmap(module, in_dims=1)(batch.movedim(0, 1)), module(batch))
    per_sample = torch.func.vmap(torch.func.grad(module))(batch)
    torch.testing.assert_close(per_sample, gradient_of(normal_variation, batch, topology))
    weights = torch.rand(3, topology.num_interior_edges, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    mapped = torch.func.vmap(lambda v, w: normal_variation(v, topology, w))(batch, weights)
    torch.testing.assert_close(mapped, normal_variation(batch, topology, weights))


def test_backward_passes_may_be_mapped_and_repeated():
    vertices, topology = mixed_grid()
    variable = torch.stack([vertices, 2 * vertices.roll(1, 1)]).requires_grad_()
    value = normal_variation(variable, topology)
    basis = torch.eye(2, dtype=DOUBLE)
    (rows,) = torch.autograd.grad(value, variable, basis, is_grads_batched=True, retain_graph=True)
    for k in range(2):
        (row,) = torch.autograd.grad(value, variable, basis[k], retain_graph=True)
        torch.testing.assert_close(rows[k], row)
    mapped = torch.func.vmap(lambda c: torch.autograd.grad(value, variable, c, retain_graph=True)[0])(basis)
    torch.testing.assert_close(mapped, rows)


def test_modes_without_gradient_have_the_same_value():
    vertices, topology = mixed_grid()
    variable = vertices.clone().requires_grad_()
    value = normal_variation(variable, topology)
    assert value.requires_grad
    with torch.no_grad():
        without = normal_variation(variable, topology)
    with torch.inference_mode():
        inference = normal_variation(variable, topology)
    assert value.item() == without.item() == inference.item() == normal_variation(vertices, topology).item()
    assert not without.requires_grad


def test_first_use_in_inference_mode_does_not_spoil_later_gradients():
    vertices, topology = mixed_grid()
    with torch.inference_mode():
        normal_variation(vertices, topology)
    assert gradient_of(normal_variation, vertices, topology).any()


@pytest.mark.parametrize("weighted", [False, True])
def test_compiles_to_one_graph_with_its_backward(weighted):
    torch._dynamo.reset()
    vertices, topology = GENERIC["triangles"]()
    weights = torch.linspace(0.5, 2, topology.num_interior_edges, dtype=DOUBLE) if weighted else None
    module = NormalVariation(Topology.from_faces(topology.face_lists()), weights)
    compiled = torch.compile(module, fullgraph=True, backend="aot_eager")
    variable = vertices.clone().requires_grad_()
    value = compiled(variable)
    torch.testing.assert_close(value, module(vertices))
    (gradient,) = torch.autograd.grad(value, variable)
    torch.testing.assert_close(gradient, gradient_of(normal_variation, vertices, topology, weights))


@every_mesh
def test_on_another_device(mesh, device):
    vertices, topology = mesh()
    there = gradient_of(normal_variation, vertices.to(device), topology.to(device))
    torch.testing.assert_close(there.cpu(), gradient_of(normal_variation, vertices, topology))
