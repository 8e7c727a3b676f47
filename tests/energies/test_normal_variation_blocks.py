"""The gradient of E in blocks: parts of batches, layouts, scratch memory, threads."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from geometry_meshes import icosphere, mixed_grid
from helpers import DOUBLE
from normal_variation_reference import every_mesh, gradient_of, plain

from torchfair import Topology
from torchfair.energies import _normal_variation_blocks as blocks_module
from torchfair.energies import _normal_variation_function as function_module
from torchfair.energies import normal_variation


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
