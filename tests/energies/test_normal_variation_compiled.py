"""Compiled loops over triangles (optional package numba) against the evaluation without it."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, icosphere
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.energies import _normal_variation_compiled as compiled_module
from torchfair.energies import normal_variation, normal_variation_per_edge

TRIANGLES = {
    name: make for name, make in (GENERIC | DEGENERATE).items() if make()[1].is_triangular and make()[1].num_faces
}


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Small meshes take the compiled loops, too."""
    pytest.importorskip("numba")
    monkeypatch.setattr(compiled_module, "FEWEST_FACES", 1)
    return monkeypatch


def dented_sphere() -> tuple[Tensor, Topology]:
    vertices, topology = icosphere(2)
    noise = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    return vertices + 0.1 * noise, topology


def value_and_gradient(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor]:
    variable = vertices.clone().requires_grad_()
    value = normal_variation(variable, topology)
    return value.detach(), torch.autograd.grad(value.sum(), variable)[0]


def both_ways(vertices: Tensor, topology: Topology, patch: pytest.MonkeyPatch) -> list[tuple[Tensor, Tensor]]:
    """By compiled loops and without; the caller's patch lets small meshes take them."""
    calls = []
    loops = compiled_module.compiled_energy_and_gradient
    function_module = sys.modules["torchfair.energies._normal_variation_function"]
    patch.setattr(function_module, "compiled_energy_and_gradient", lambda *given: (calls.append(1), loops(*given))[1])
    fast = value_and_gradient(vertices, topology)
    assert calls == [1]
    patch.setattr(compiled_module, "FEWEST_FACES", 10**9)
    slow = value_and_gradient(vertices, topology)
    assert calls == [1]
    return [fast, slow]


def same(fast: tuple[Tensor, Tensor], slow: tuple[Tensor, Tensor]) -> None:
    for one, other in zip(fast, slow, strict=True):
        finite = other[other.isfinite()].abs()
        size = finite.max().item() if finite.numel() else 1.0
        torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-12 * size, equal_nan=True)


@pytest.mark.parametrize("mesh", TRIANGLES.values(), ids=TRIANGLES)
def test_as_without(mesh: Callable[[], tuple[Tensor, Topology]], compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = mesh()
    same(*both_ways(vertices.to(DOUBLE), topology, compiled))


@pytest.mark.parametrize("size", [1e-150, 1e-40, 1.0, 1e90, 1e150])
def test_of_any_size(size: float, compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    same(*both_ways(vertices * size, topology, compiled))
    # E is as long as the mesh, its gradient has no unit.
    compiled.setattr(compiled_module, "FEWEST_FACES", 1)
    (energy, slope), (unit_energy, unit_slope) = (value_and_gradient(vertices * s, topology) for s in (size, 1.0))
    torch.testing.assert_close(energy / size, unit_energy, rtol=1e-11, atol=0.0)
    torch.testing.assert_close(slope, unit_slope, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_parts_add_up(threads: int, compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    compiled.setattr(torch, "get_num_threads", lambda: threads)
    same(*both_ways(vertices, topology, compiled))


def test_flat_edges_and_boundary(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    same(*both_ways(vertices, topology, compiled))
    compiled.setattr(compiled_module, "FEWEST_FACES", 1)
    i, j = torch.meshgrid(*(torch.arange(float(count), dtype=DOUBLE) for count in (6, 5)), indexing="ij")
    plane = torch.stack([i, j, 0.0 * i], -1).view(-1, 3)
    energy, slope = value_and_gradient(plane, topology)
    assert energy == 0.0
    assert not slope.any()


@pytest.mark.parametrize("height", [3e-16, 1e-15, 1e-14, 1e-12])
def test_slivers(height: float, compiled: pytest.MonkeyPatch) -> None:
    """Both sides of the bound below which a triangle is degenerate."""
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0.5, height, 0], [0.5, 1, 1], [0.5, -1, 0]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2], [2, 1, 3], [0, 4, 1]])
    same(*both_ways(vertices, topology, compiled))


def test_triangles_whose_areas_nearly_vanish(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    tiny = 3e-78 * torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=DOUBLE)
    faces = torch.cat([topology.corners.view(-1, 3), topology.num_vertices + torch.tensor([[0, 1, 2], [0, 3, 1]])])
    together = torch.cat([vertices, tiny])
    fast, slow = both_ways(together, Topology.from_faces(faces), compiled)
    same(fast, slow)
    torch.testing.assert_close(fast[1][-4:], slow[1][-4:], rtol=1e-10, atol=0.0)


def test_no_number_stays_none(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    vertices[3, 1] = torch.nan
    (fast, slope), (slow, expected) = both_ways(vertices, topology, compiled)
    assert fast.isnan()
    assert slow.isnan()
    assert torch.equal(slope.isnan(), expected.isnan())


@pytest.mark.parametrize("value", [torch.nan, torch.inf, 1.7e308])
def test_what_is_no_number_is_none_where_it_is_without(value: float, compiled: pytest.MonkeyPatch) -> None:
    """Of two spheres, one of them finite, so large that squares overflow where no unit is found."""
    vertices, topology = dented_sphere()
    apart = torch.cat([vertices, vertices])
    faces = topology.corners.view(-1, 3)
    both = Topology.from_faces(torch.cat([faces, faces + topology.num_vertices]))
    for size in (1.0, 1e150):
        broken = size * apart
        broken[3, 1] = value
        same(*both_ways(broken, both, compiled))
        compiled.setattr(compiled_module, "FEWEST_FACES", 1)


def test_empty_batch(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    for shape in ((0,), (2, 0)):
        energy, slope = value_and_gradient(vertices.expand(*shape, -1, -1), topology)
        assert energy.shape == shape
        assert slope.shape == (*shape, *vertices.shape)


def test_batch_and_value_alone(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    batch = torch.stack([vertices, 2.0 * vertices, vertices.flip(1)]).reshape(3, 1, -1, 3)
    fast, slow = both_ways(batch, topology, compiled)
    assert fast[0].shape == (3, 1)
    same(fast, slow)
    compiled.setattr(compiled_module, "FEWEST_FACES", 1)
    with torch.no_grad():
        assert torch.equal(normal_variation(batch, topology), fast[0])
    strided = vertices.mT.contiguous().mT
    assert torch.equal(normal_variation(strided, topology), fast[0][0, 0])


def test_derivatives(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = icosphere(0)
    vertices = (vertices + 0.1 * torch.sin(9 * vertices.flip(1))).requires_grad_()

    def energy(positions: Tensor) -> Tensor:
        return normal_variation(positions, topology)

    assert torch.autograd.gradcheck(energy, vertices)
    assert torch.autograd.gradgradcheck(energy, vertices)
    expected = torch.func.grad(lambda positions: normal_variation_per_edge(positions, topology).sum())(vertices)
    torch.testing.assert_close(torch.func.grad(energy)(vertices), expected)
    each = torch.func.vmap(torch.func.grad(energy))(torch.stack([vertices, vertices]))
    torch.testing.assert_close(each, torch.stack([expected, expected]))


def test_what_it_does_not_serve(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    serves = compiled_module.compiled_serves
    weights = torch.ones(topology.num_interior_edges, dtype=DOUBLE)
    quads = wavy_grid(3, 3)
    assert serves(vertices, None, topology)
    assert not serves(vertices.float(), None, topology)
    assert not serves(vertices, weights, topology)
    assert not serves(quads[0], None, quads[1])
    assert not serves(vertices.to("meta"), None, topology)
    assert not serves(torch.cat([vertices, vertices]), None, Topology.join([topology, topology]))
    compiled.setattr(compiled_module, "is_installed", lambda: False)
    assert not serves(vertices, None, topology)


def test_topologies_are_copied_and_stored_with_it(compiled: pytest.MonkeyPatch) -> None:
    vertices, topology = dented_sphere()
    expected = normal_variation(vertices, topology)
    for other in (copy.deepcopy(topology), pickle.loads(pickle.dumps(topology))):
        assert torch.equal(normal_variation(vertices, other), expected)


def test_small_meshes_do_not_import_it() -> None:
    script = (
        "import sys, torch; from torchfair import Topology; from torchfair.energies import normal_variation;"
        "topology = Topology.from_faces([[0, 1, 2], [0, 2, 3]]);"
        "normal_variation(torch.rand(4, 3, dtype=torch.float64), topology); print('numba' in sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "False"


def test_large_meshes_take_it_as_they_are() -> None:
    pytest.importorskip("numba")
    columns, rows = 200, 130
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a, b, c, d = ((i + p) % rows * columns + (j + q) % columns for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
    topology = Topology.from_faces(np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3))
    random = np.random.default_rng(0)
    shaken = (part + 0.3 * random.uniform(size=(rows, columns)) for part in (i, j))
    around, across = (
        torch.from_numpy(2 * np.pi * part.ravel() / count) for part, count in zip(shaken, (rows, columns), strict=True)
    )
    distance = 3 + across.cos()
    vertices = torch.stack([distance * around.cos(), distance * around.sin(), across.sin()], -1)
    assert compiled_module.compiled_serves(vertices, None, topology)
    fast = value_and_gradient(vertices, topology)
    variable = vertices.clone().requires_grad_()
    expected = normal_variation_per_edge(variable, topology).sum()
    same(fast, (expected.detach(), torch.autograd.grad(expected, variable)[0]))
