"""What holds for every energy module: shapes, functional form, state, moving, transforms, compilation."""

from __future__ import annotations

import copy
import io
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import hypothesis.strategies as st
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, mixed_grid, with_isolated
from helpers import DOUBLE, random_rotation, wavy_grid
from hypothesis import given, settings
from torch import Tensor, nn

from torchfair import ShapeError, Topology, energies


@dataclass(frozen=True)
class Energy:
    """A module, its functional forms, and its laws."""

    module: Callable[[Topology], energies.MeshModule]
    function: Callable[[Tensor, Topology], Tensor]
    terms: Callable[[Tensor, Topology], Tensor]
    method: str
    power: int
    odd: bool = False

    def __call__(self, vertices: Tensor, topology: Topology) -> Tensor:
        return self.function(vertices, topology)


ENERGIES = {
    "angle_variation": Energy(
        energies.AngleVariation, energies.angle_variation, energies.angle_variation_per_edge, "per_edge", 1
    ),
    "total_mean_curvature": Energy(
        energies.TotalMeanCurvature,
        energies.total_mean_curvature,
        energies.total_mean_curvature_per_edge,
        "per_edge",
        1,
        odd=True,
    ),
    "umbrella_fairness": Energy(
        energies.UmbrellaFairness, energies.umbrella_fairness, energies.umbrella_fairness_per_vertex, "per_vertex", 2
    ),
    "polyline_fairness": Energy(
        energies.PolylineFairness, energies.polyline_fairness, energies.polyline_fairness_per_triple, "per_triple", 2
    ),
    "total_absolute_curvature": Energy(
        energies.TotalAbsoluteCurvature,
        energies.total_absolute_curvature,
        energies.total_absolute_curvature_per_vertex,
        "per_vertex",
        1,
    ),
    "total_frobenius_curvature, corrected and extrapolated": Energy(
        partial(energies.TotalFrobeniusCurvature, estimator="corrected", boundary="extrapolated"),
        partial(energies.total_frobenius_curvature, estimator="corrected", boundary="extrapolated"),
        partial(energies.total_frobenius_curvature_per_vertex, estimator="corrected", boundary="extrapolated"),
        "per_vertex",
        1,
    ),
    "willmore_energy": Energy(
        energies.WillmoreEnergy, energies.willmore_energy, energies.willmore_energy_per_vertex, "per_vertex", 0
    ),
    "willmore_energy, bending, extrapolated": Energy(
        partial(energies.WillmoreEnergy, density="bending", boundary="extrapolated"),
        partial(energies.willmore_energy, density="bending", boundary="extrapolated"),
        partial(energies.willmore_energy_per_vertex, density="bending", boundary="extrapolated"),
        "per_vertex",
        0,
    ),
}
every_energy = pytest.mark.parametrize("energy", ENERGIES.values(), ids=ENERGIES.keys())
edge_energies = pytest.mark.parametrize("module", [energies.AngleVariation, energies.TotalMeanCurvature])
every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
every_degenerate_mesh = pytest.mark.parametrize("mesh", DEGENERATE.values(), ids=DEGENERATE.keys())


@every_energy
@every_mesh
def test_module_functions_terms_and_batches_agree(energy, mesh):
    vertices, topology = mesh()
    module = energy.module(topology)
    batch = torch.stack([vertices * s + 0.1 * s**2 * vertices.roll(1, 0) for s in range(1, 7)]).unflatten(0, (2, 3))
    for dtype in (torch.float32, torch.float64):
        some = batch.to(dtype)
        value = module(some)
        assert value.shape == (2, 3)
        assert value.dtype == dtype
        torch.testing.assert_close(value, energy(some, topology))
        torch.testing.assert_close(value, torch.stack([torch.stack([module(v) for v in row]) for row in some]))
        torch.testing.assert_close(value, torch.func.vmap(torch.func.vmap(module))(some))
        terms = getattr(module, energy.method)(some)
        torch.testing.assert_close(terms.sum(-1), value)
        torch.testing.assert_close(terms, energy.terms(some, topology))
        assert module(some[0, 0]).shape == ()


@every_energy
@every_mesh
def test_gradcheck(energy, mesh):
    vertices, topology = mesh()
    variable = vertices.clone().requires_grad_()
    assert torch.autograd.gradcheck(lambda v: energy(v, topology), variable, fast_mode=True, check_forward_ad=True)
    assert torch.autograd.gradgradcheck(lambda v: energy(v, topology), variable, fast_mode=True)


@every_energy
def test_function_transforms(energy):
    vertices, topology = GENERIC["quads"]()
    module = energy.module(topology)
    gradient = torch.func.jacrev(module)(vertices)
    torch.testing.assert_close(torch.func.jacfwd(module)(vertices), gradient)
    batch = torch.stack([vertices, vertices.roll(1, 1)])
    per_sample = torch.func.vmap(torch.func.grad(module))(batch)
    torch.testing.assert_close(per_sample[0], gradient)
    torch.testing.assert_close(per_sample[1], torch.func.grad(module)(batch[1]))


@every_energy
@every_mesh
def test_scaling_rigid_motion_and_relabelling(energy, mesh):
    vertices, topology = mesh()
    value = energy(vertices, topology)
    moved = 2.5 * vertices @ random_rotation(7).T + torch.tensor([3.0, -1, 2], dtype=DOUBLE)
    torch.testing.assert_close(energy(moved, topology), 2.5**energy.power * value)
    order = torch.randperm(topology.num_vertices, generator=torch.Generator().manual_seed(3))
    new = order.argsort().tolist()
    faces = [[new[v] for v in face[1:] + face[:1]] for face in reversed(topology.face_lists())]
    relabelled = Topology.from_faces(faces, topology.num_vertices)
    torch.testing.assert_close(energy(vertices[order], relabelled), value)
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()], topology.num_vertices)
    torch.testing.assert_close(energy(vertices, turned), -value if energy.odd else value)


@every_energy
@every_degenerate_mesh
def test_finite_with_all_derivatives_on_degenerate_meshes(energy, mesh):
    check_finite(energy, *mesh())


@settings(max_examples=10, deadline=None)
@given(coordinates=st.lists(st.integers(-1, 1), min_size=48, max_size=48), quads=st.booleans())
def test_finite_on_lattice_points(coordinates, quads):
    """Few places for many vertices: coincident and collinear corners, flat and folded edges abound."""
    _, topology = GENERIC["quads"]() if quads else GENERIC["triangles"]()
    vertices = torch.tensor(coordinates, dtype=DOUBLE).view(-1, 3)[: topology.num_vertices]
    for energy in ENERGIES.values():
        check_finite(energy, vertices, topology)


def check_finite(energy: Energy, vertices: Tensor, topology: Topology) -> None:
    direction = torch.linspace(-1, 1, vertices.numel(), dtype=DOUBLE).view_as(vertices).sin()
    value, along = torch.func.jvp(lambda v: energy(v, topology), (vertices,), (direction,))
    variable = vertices.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(energy(variable, topology), variable, create_graph=True)
    (second,) = torch.autograd.grad((gradient * direction).sum(), variable, materialize_grads=True)
    for tensor in (value, along, gradient, second):
        assert tensor.isfinite().all()
    torch.testing.assert_close((gradient * direction).sum(), along)


@every_energy
def test_isolated_vertices_change_nothing(energy):
    vertices, topology = mixed_grid()
    more, larger = with_isolated((vertices, topology))
    torch.testing.assert_close(energy(more, larger), energy(vertices, topology))
    gradient = torch.func.grad(lambda v: energy(v, larger))(more)
    assert not gradient[-1].any()
    torch.testing.assert_close(gradient[:-1], torch.func.grad(lambda v: energy(v, topology))(vertices))


@every_energy
def test_copies_pickles_and_saves(energy):
    vertices, topology = mixed_grid()
    module = energy.module(topology)
    value = module(vertices)
    buffer = io.BytesIO()
    torch.save(module, buffer)
    buffer.seek(0)
    others = [copy.deepcopy(module), pickle.loads(pickle.dumps(module)), torch.load(buffer, weights_only=False)]
    for other in others:
        assert other(vertices).item() == value.item()
    module.load_state_dict(others[0].state_dict())
    assert module.state_dict() == {}


@every_energy
def test_dtype_conversions_and_meta_leave_the_topology_alone(energy):
    vertices, topology = mixed_grid()
    module = energy.module(topology)
    value = module(vertices)
    for convert in (
        lambda m: m.half(),
        lambda m: m.to(torch.float32),
        lambda m: m.type(DOUBLE),
        lambda m: m.share_memory(),
        lambda m: m.to("meta"),
        lambda m: m.to_empty(device="cpu"),
    ):
        convert(module)
        assert module.topology is topology
        assert module(vertices).item() == value.item()


@every_energy
def test_follows_to_a_device(energy, device):
    vertices, topology = mixed_grid()
    module = energy.module(topology)
    parent = nn.Sequential(module).to(device)
    assert module.topology.device == device
    assert topology.device.type == "cpu"
    assert all(name in vars(module.topology) for name in module.needs)
    torch.testing.assert_close(parent(vertices.to(device)).cpu(), energy(vertices, topology))


@every_energy
def test_compiles_to_one_graph_with_its_backward(energy):
    torch._dynamo.reset()
    vertices, topology = GENERIC["triangles"]()
    module = energy.module(Topology.from_faces(topology.face_lists()))  # no table filled but by the module itself
    compiled = torch.compile(module, fullgraph=True, backend="aot_eager")
    variable = vertices.clone().requires_grad_()
    value = compiled(variable)
    torch.testing.assert_close(value, module(vertices))
    (gradient,) = torch.autograd.grad(value, variable)
    torch.testing.assert_close(gradient, torch.func.grad(module)(vertices))


def test_functions_compile_for_one_mesh_after_another():
    """From the second mesh on, torch.compile takes the sizes of the topology for symbols."""
    torch._dynamo.reset()
    fairness = torch.compile(energies.umbrella_fairness, fullgraph=True, backend="eager")
    variation = torch.compile(energies.angle_variation, fullgraph=True, backend="eager")
    for mesh in ("triangles", "quads", "mixed"):
        vertices, topology = GENERIC[mesh]()
        weights = torch.rand(topology.num_interior_edges, dtype=DOUBLE)
        expected = energies.umbrella_fairness(vertices, topology)  # also fills the tables of the topology
        torch.testing.assert_close(fairness(vertices, topology), expected)
        expected = energies.angle_variation(vertices, topology, weights)
        torch.testing.assert_close(variation(vertices, topology, weights), expected)


def test_functional_call_replaces_the_weights():
    vertices, topology = mixed_grid()
    weights = torch.rand(topology.num_interior_edges, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    module = energies.AngleVariation(topology, torch.ones_like(weights))
    value = torch.func.functional_call(module, {"edge_weights": weights}, (vertices,))
    torch.testing.assert_close(value, energies.angle_variation(vertices, topology, weights))
    torch.testing.assert_close(module(vertices), energies.angle_variation(vertices, topology))


@edge_energies
def test_weights_multiply_the_terms_and_live_in_the_state(module):
    vertices, topology = mixed_grid()
    weights = torch.linspace(-1, 2, topology.num_interior_edges, dtype=DOUBLE)
    weighted, plain = module(topology, weights), module(topology)
    torch.testing.assert_close(weighted.per_edge(vertices), plain.per_edge(vertices) * weights)
    torch.testing.assert_close(weighted(vertices), (plain.per_edge(vertices) * weights).sum())
    assert list(weighted.state_dict()) == ["edge_weights"]
    other = module(topology, torch.zeros_like(weights))
    other.load_state_dict(weighted.state_dict())
    torch.testing.assert_close(other(vertices), weighted(vertices))
    assert weighted(vertices.float()).dtype == torch.float32
    single = weighted.to(torch.float32)
    assert single.edge_weights.dtype == torch.float32
    assert single(vertices).dtype == DOUBLE


@edge_energies
def test_weights_may_differ_within_a_batch(module):
    vertices, topology = mixed_grid()
    weights = torch.linspace(0, 1, 3 * topology.num_interior_edges, dtype=DOUBLE).view(3, -1)
    expected = torch.stack([module(topology, w)(vertices) for w in weights])
    torch.testing.assert_close(module(topology, weights)(vertices), expected)


@edge_energies
@pytest.mark.parametrize("weights", [torch.ones(3), torch.ones(24, dtype=torch.int64), [1.0] * 24, torch.tensor(1.0)])
def test_refuses_other_weights(module, weights):
    _, topology = mixed_grid()
    with pytest.raises(ShapeError, match=r"edge_weights: expected a floating tensor \(24,\)"):
        module(topology, weights)


@every_energy
def test_refuses_wrong_vertices(energy):
    vertices, topology = mixed_grid()
    module = energy.module(topology)
    with pytest.raises(ShapeError, match=r"expected a floating tensor \(\*batch, 25, 3\), got \(25, 2\)"):
        module(vertices[:, :2])


@every_energy
def test_says_what_it_holds(energy):
    assert "Topology(polygon mesh: 25 vertices" in repr(energy.module(mixed_grid()[1]))


@every_energy
def test_descent_lowers_it(energy):
    """The pattern of a training loop: parameters, optimiser, energy as the loss."""
    vertices, topology = mixed_grid()
    parameter = nn.Parameter(vertices.clone())
    module = energy.module(topology)
    optimiser = torch.optim.Adam([parameter], lr=1e-2)
    start = module(parameter).item()
    for _ in range(20):
        optimiser.zero_grad()
        loss = module(parameter)
        loss.backward()
        optimiser.step()
    assert module(parameter).item() < start - 0.1


def test_a_fresh_topology_may_first_be_used_inside_nested_transforms() -> None:
    """Tables filled lazily under a transform would keep its tensors and break the next call."""
    vertices, topology = wavy_grid(5, 5)

    def total(points: torch.Tensor) -> torch.Tensor:
        return energies.umbrella_fairness(points, topology) + energies.angle_variation(points, topology)

    torch.func.vjp(torch.func.grad(total), vertices)[1](vertices)
    assert torch.func.grad(total)(vertices).isfinite().all()
    assert total(vertices).isfinite()


@pytest.mark.parametrize(
    "name", ["normal_variation_per_edge", "angle_variation_per_edge", "total_mean_curvature_per_edge"]
)
def test_nan_vertices_do_not_pass_for_a_flat_mesh(name: str) -> None:
    vertices, topology = wavy_grid(5, 5, triangles=True)
    vertices[7, 1] = float("nan")
    assert getattr(energies, name)(vertices, topology).isnan().any()
