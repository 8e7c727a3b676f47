"""The gradient of the normal variation: Prop. 2 as printed, the fast path against autograd, further derivatives."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, icosphere, mixed_grid
from helpers import DOUBLE, random_rotation, wavy_grid
from hypothesis import given, settings
from torch import Tensor
from torch.autograd import forward_ad

from torchfair import Topology
from torchfair.energies import NormalVariation, normal_variation, normal_variation_per_edge
from torchfair.energies import _normal_variation_blocks as blocks_module
from torchfair.energies import _normal_variation_function as function_module

every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC)
every_degenerate_mesh = pytest.mark.parametrize("mesh", DEGENERATE.values(), ids=DEGENERATE)


def dented_sphere() -> tuple[Tensor, Topology]:
    """Closed triangle mesh with convex and concave edges."""
    vertices, topology = icosphere(1)
    noise = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    return vertices + 0.15 * noise, topology


def plain(vertices: Tensor, topology: Topology, weights: Tensor | None = None) -> Tensor:
    """E by autograd of the geometry functions."""
    return normal_variation_per_edge(vertices, topology, weights).sum(-1)


def gradient_of(function, vertices: Tensor, *others) -> Tensor:
    variable = vertices.clone().requires_grad_()
    return torch.autograd.grad(function(variable, *others).sum(), variable)[0]


def formula_one(vertices: np.ndarray, faces: list[list[int]]) -> np.ndarray:
    """Formula (1) of the paper for triangle meshes: its three sums, vertex by vertex."""
    area, normal, face_at = {}, {}, {}
    for face in faces:
        p, q, r = vertices[face]
        doubled = np.cross(q - p, r - p)
        area[tuple(face)] = np.linalg.norm(doubled) / 2
        normal[tuple(face)] = doubled / np.linalg.norm(doubled)
        for k in range(3):
            face_at[face[k], face[(k + 1) % 3]] = tuple(face)  # the face that traverses the edge this way

    def project(f, x):
        return x - normal[f] * (normal[f] @ x)

    def third(f, v, w):
        return next(u for u in f if u not in (v, w))

    gradient = np.zeros_like(vertices)
    for (v, w), f in face_at.items():
        # v w is an edge at v with f = v w w+ on its left and f' = v w- w on its right ...
        if (w, v) in face_at:
            g = face_at[w, v]
            plus, minus = third(f, v, w), third(g, v, w)
            length = np.linalg.norm(vertices[v] - vertices[w])
            dual = np.linalg.norm(normal[f] - normal[g])
            gradient[v] += dual / length * (vertices[v] - vertices[w])
            gradient[v] += length * np.cross(
                (vertices[plus] - vertices[w]) / (2 * area[f]), project(f, normal[g]) / dual
            )
            gradient[v] += length * np.cross(
                (vertices[w] - vertices[minus]) / (2 * area[g]), project(g, normal[f]) / dual
            )
            # ... and seen from w it is the other way round.
            gradient[w] += dual / length * (vertices[w] - vertices[v])
            gradient[w] += length * np.cross(
                (vertices[minus] - vertices[v]) / (2 * area[g]), project(g, normal[f]) / dual
            )
            gradient[w] += length * np.cross(
                (vertices[v] - vertices[plus]) / (2 * area[f]), project(f, normal[g]) / dual
            )
    gradient /= 2  # both directions of each edge have been visited
    for (w, plus), f in face_at.items():
        # w w+ is the edge opposite to v in f.
        if (plus, w) in face_at:
            v, g = third(f, w, plus), face_at[plus, w]
            length = np.linalg.norm(vertices[w] - vertices[plus])
            dual = np.linalg.norm(normal[f] - normal[g])
            gradient[v] += length * np.cross(
                (vertices[plus] - vertices[w]) / (2 * area[f]), project(f, normal[g]) / dual
            )
    return gradient


# ---- Prop. 2 -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [GENERIC["triangles"], GENERIC["closed"], dented_sphere])
def test_is_that_of_proposition_two(mesh):
    vertices, topology = mesh()
    expected = torch.from_numpy(formula_one(vertices.numpy(), topology.face_lists()))
    torch.testing.assert_close(gradient_of(normal_variation, vertices, topology), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("mesh", [*GENERIC.values(), dented_sphere], ids=[*GENERIC, "dented sphere"])
def test_equals_autograd_of_the_plain_formula(mesh):
    vertices, topology = mesh()
    weights = torch.linspace(-1, 2, topology.num_interior_edges, dtype=DOUBLE)
    for others in ((topology,), (topology, weights)):
        ours, theirs = gradient_of(normal_variation, vertices, *others), gradient_of(plain, vertices, *others)
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=1e-13)


def test_first_order_does_not_use_the_plain_formula(monkeypatch):
    """Otherwise the comparisons here would compare it with itself."""
    vertices, topology = dented_sphere()
    expected = gradient_of(plain, vertices, topology)

    def forbidden(*_):
        raise AssertionError("plain formula called")

    monkeypatch.setattr(function_module, "plain_terms", forbidden)
    torch.testing.assert_close(gradient_of(normal_variation, vertices, topology), expected)
    dual = vertices.clone().requires_grad_()
    normal_variation(dual, topology).backward()
    torch.testing.assert_close(dual.grad, expected)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(0.01, 2))
def test_forces_keep_balance_and_do_the_work_of_scaling(seed, size):
    """E ignores translation and rotation and scales with length (Euler's identity)."""
    vertices, topology = mixed_grid()
    noise = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
    vertices = vertices + size * noise
    force = gradient_of(normal_variation, vertices, topology)
    tolerance = 1e-11 * force.norm(dim=-1).sum().item()
    assert force.sum(0).norm().item() < tolerance
    assert torch.linalg.cross(vertices, force).sum(0).norm().item() < 10 * tolerance
    assert (vertices * force).sum().item() == pytest.approx(normal_variation(vertices, topology).item(), abs=tolerance)


# ---- blocks, batches, layouts ----------------------------------------------------------------------------------


@every_mesh
@pytest.mark.parametrize("limit", [1, 3, 7])
def test_blocks_and_parts_of_batches_fit_together(mesh, limit, monkeypatch):
    monkeypatch.setattr(blocks_module, "faces_per_block", lambda on_cpu: limit)
    monkeypatch.setattr(function_module, "faces_per_block", lambda on_cpu: 2 * limit)
    vertices, topology = mesh()
    fresh = Topology.from_faces(topology.face_lists())
    batch = torch.stack([vertices * s + 0.1 * s**2 * vertices.roll(1, 0) for s in range(1, 6)])
    weights = torch.linspace(-1, 2, 5 * fresh.num_interior_edges, dtype=DOUBLE).view(5, -1)
    for others in ((fresh,), (fresh, weights[0]), (fresh, weights)):
        torch.testing.assert_close(normal_variation(batch, *others), plain(batch, *others))
        torch.testing.assert_close(gradient_of(normal_variation, batch, *others), gradient_of(plain, batch, *others))
    torch.testing.assert_close(normal_variation(batch[0], fresh), plain(batch[0], topology))
    assert len(blocks_module.tables_of(fresh).blocks) >= fresh.num_faces / limit


def test_gradients_of_batches_equal_loops():
    vertices, topology = mixed_grid()
    batch = torch.stack([vertices * s + 0.1 * s**2 * vertices.roll(1, 0) for s in range(1, 7)]).unflatten(0, (2, 3))
    loop = [gradient_of(normal_variation, v, topology) for v in batch.flatten(0, 1)]
    torch.testing.assert_close(gradient_of(normal_variation, batch, topology).flatten(0, 1), torch.stack(loop))
    factors = torch.linspace(-1, 2, 6, dtype=DOUBLE).view(2, 3)
    variable = batch.clone().requires_grad_()
    (weighted,) = torch.autograd.grad(normal_variation(variable, topology), variable, factors)
    expected = factors.view(-1, 1, 1) * torch.stack(loop)
    torch.testing.assert_close(weighted.flatten(0, 1), expected)


def test_layout_in_memory_does_not_matter():
    vertices, topology = mixed_grid()
    expected = gradient_of(normal_variation, vertices, topology)
    columns = vertices.t().contiguous().requires_grad_()
    normal_variation(columns.t(), topology).backward()
    torch.testing.assert_close(columns.grad.t(), expected)
    wide = torch.cat([vertices, vertices], 1).requires_grad_()
    normal_variation(wide[:, 3:], topology).backward()
    torch.testing.assert_close(wide.grad, torch.cat([torch.zeros_like(vertices), expected], 1))
    single = vertices.clone().requires_grad_()
    normal_variation(single.expand(4, -1, -1), topology).sum().backward()
    torch.testing.assert_close(single.grad, 4 * expected)


def test_results_survive_later_evaluations_that_reuse_the_scratch_memory():
    vertices, topology = mixed_grid()
    variable = vertices.clone().requires_grad_()
    value = normal_variation(variable, topology)
    expected = gradient_of(plain, vertices, topology)
    for dtype in (torch.float32, torch.float64):
        gradient_of(normal_variation, torch.stack([vertices, vertices.roll(1, 0)]).to(dtype), topology)
    (gradient,) = torch.autograd.grad(value, variable)
    kept = gradient.clone()
    gradient_of(normal_variation, 2 * vertices, topology)
    torch.testing.assert_close(gradient, expected)
    assert torch.equal(gradient, kept)
    for twin in (copy.deepcopy(topology), pickle.loads(pickle.dumps(topology))):
        torch.testing.assert_close(gradient_of(normal_variation, vertices, twin), expected)


def test_pickles_do_not_carry_the_scratch_memory():
    vertices, topology = mixed_grid()
    normal_variation(vertices.float(), topology)
    size = len(pickle.dumps(topology))
    normal_variation(torch.stack([vertices] * 50), topology)
    assert len(pickle.dumps(topology)) == size


def test_threads_may_share_a_topology():
    vertices, topology = icosphere(3)
    scales = torch.linspace(1, 2, 64).tolist()
    expected = normal_variation(vertices, topology).item()

    def work(scale: float) -> float:
        return gradient_of(normal_variation, scale * vertices, topology).mul(vertices).sum().item()

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(work, scales)) == pytest.approx([expected] * len(scales))


def test_weights_shared_by_a_batch_or_not_have_gradients():
    vertices, topology = mixed_grid()
    batch = torch.stack([vertices, 2 * vertices.roll(1, 1)])
    for shape in ((topology.num_interior_edges,), (1, topology.num_interior_edges), (2, topology.num_interior_edges)):
        weights = torch.rand(shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0)).requires_grad_()
        (slope,) = torch.autograd.grad(normal_variation(batch, topology, weights).sum(), weights)
        (expected,) = torch.autograd.grad(plain(batch, topology, weights).sum(), weights)
        torch.testing.assert_close(slope, expected)


@every_mesh
def test_single_precision(mesh):
    vertices, topology = mesh()
    gradient = gradient_of(normal_variation, vertices.float(), topology)
    assert gradient.dtype == torch.float32
    expected = gradient_of(normal_variation, vertices, topology)
    torch.testing.assert_close(gradient.double(), expected, rtol=0, atol=2e-5 * expected.abs().max().item())


# ---- flat edges and degenerate input --------------------------------------------------------------------------


@every_degenerate_mesh
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_equals_autograd_of_the_plain_formula_on_degenerate_meshes(mesh, dtype):
    vertices, topology = mesh()
    check_degenerate(vertices.to(dtype), topology)


@settings(max_examples=40, deadline=None)
@given(coordinates=st.lists(st.integers(-1, 1), min_size=75, max_size=75), name=st.sampled_from(["triangles", "mixed"]))
def test_equals_autograd_of_the_plain_formula_on_lattice_points(coordinates, name):
    """Few places for many vertices: coincident and collinear corners, flat and folded edges abound."""
    _, topology = GENERIC[name]()
    check_degenerate(torch.tensor(coordinates, dtype=DOUBLE).view(-1, 3)[: topology.num_vertices], topology)


def check_degenerate(vertices: Tensor, topology: Topology) -> None:
    weights = torch.linspace(-1, 2, topology.num_interior_edges, dtype=vertices.dtype)
    for others in ((topology,), (topology, weights)):
        torch.testing.assert_close(normal_variation(vertices, *others), plain(vertices, *others))
        ours, theirs = gradient_of(normal_variation, vertices, *others), gradient_of(plain, vertices, *others)
        torch.testing.assert_close(ours, theirs)
        assert ours.isfinite().all()
    variable = vertices.clone().requires_grad_()
    (slope,) = torch.autograd.grad(normal_variation(variable, topology), variable, create_graph=True)
    (second,) = torch.autograd.grad(
        (slope * torch.linspace(-1, 1, 3).to(slope)).sum(), variable, materialize_grads=True
    )
    assert second.isfinite().all()


def test_nearly_flat_edges_do_not_cost_digits():
    """l/l* is 1e6 here: rounding of normals along themselves must not get into the gradient."""
    vertices, topology = GENERIC["triangles"]()
    flattened = vertices * torch.tensor([1, 1, 1e-6], dtype=DOUBLE) @ random_rotation(1).T
    ours, theirs = gradient_of(normal_variation, flattened, topology), gradient_of(plain, flattened, topology)
    torch.testing.assert_close(ours, theirs, rtol=0, atol=1e-13)


def test_sides_of_length_zero_are_safe_where_the_face_has_area():
    """A quad with two corners in one place is a triangle for E, and its short side has length 0."""
    points = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 1, 0.3], [0, 1, 0.3], [1, 2, 0.9], [0, 2, 0.4]]
    vertices = torch.tensor(points, dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2, 3, 4], [3, 2, 5, 6], [4, 3, 6]])
    assert topology.num_interior_edges == 3
    check_degenerate(vertices, topology)
    assert normal_variation(vertices, topology).item() > 0.1


# ---- further derivatives and transforms --------------------------------------------------------------------------


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
