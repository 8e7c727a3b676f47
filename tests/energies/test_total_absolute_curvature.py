from __future__ import annotations

import itertools
import math
from functools import partial

import hypothesis.strategies as st
import pytest
import torch
from geometry_meshes import GENERIC, capped_prism, flat_pair, flat_squares, mixed_grid
from helpers import DOUBLE, cube
from hypothesis import given, settings

from torchfair import Topology, TorchfairError
from torchfair.energies import (
    TotalAbsoluteCurvature,
    angle_variation,
    normal_variation,
    total_absolute_curvature,
    total_absolute_curvature_per_vertex,
    total_frobenius_curvature,
    total_mean_curvature,
)
from torchfair.geometry import dihedral_angles, edge_lengths, shape_operators, tangential_shape_operators
from torchfair.shapes import (
    Catenoid,
    Enneper,
    Helicoid,
    Paraboloid,
    Torus,
    icosphere,
    parameter_quads,
    parameter_triangles,
    principal_quads,
    rotated_lattice,
)

normal_cycle = partial(total_absolute_curvature, estimator="normal_cycle")
with_angles = partial(total_absolute_curvature, sine=False)
corrected = partial(total_absolute_curvature, estimator="corrected")
completed = partial(total_absolute_curvature, boundary="extrapolated")
METHODS = {"sine": normal_cycle, "angle": with_angles, "corrected": corrected}
each_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS.keys())


# ---- C, E and E' ---------------------------------------------------------------------------------------


def chain(vertices: torch.Tensor, topology: Topology) -> list[float]:
    """C2, C, sum l |sin a|, E, E': never falling."""
    angles = dihedral_angles(vertices, topology)
    lengths = edge_lengths(vertices, topology)[..., : topology.num_interior_edges]
    sines = (lengths * angles.sin().abs()).sum(-1)
    energies = (normal_variation(vertices, topology), angle_variation(vertices, topology))
    curvature = total_absolute_curvature(vertices, topology)
    return [x.item() for x in (total_frobenius_curvature(vertices, topology), curvature, sines, *energies)]


def ratio(vertices: torch.Tensor, topology: Topology) -> float:
    """C over E."""
    return (total_absolute_curvature(vertices, topology) / normal_variation(vertices, topology)).item()


def check_chain(vertices: torch.Tensor, topology: Topology) -> None:
    values = chain(vertices, topology)
    slack = 1e-12 * (1 + values[-1])
    assert all(smaller <= larger + slack for smaller, larger in itertools.pairwise(values))
    assert values[1] <= math.sqrt(2) * values[0] + slack


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(sorted(GENERIC)),
    seed=st.integers(0, 10**6),
    crumple=st.sampled_from([0.0, 0.01, 0.3, 3.0]),
)
def test_curvature_is_never_above_the_energies(name, seed, crumple):
    """Smooth, rough and crumpled meshes, planar faces or not: each step only drops cancellation."""
    vertices, topology = GENERIC[name]()
    random = torch.Generator().manual_seed(seed)
    check_chain(vertices + crumple * torch.randn(vertices.shape, dtype=DOUBLE, generator=random), topology)


@settings(max_examples=30, deadline=None)
@given(coordinates=st.lists(st.integers(-1, 1), min_size=48, max_size=48), quads=st.booleans())
def test_curvature_is_never_above_the_energies_on_degenerate_meshes(coordinates, quads):
    _, topology = GENERIC["quads"]() if quads else GENERIC["triangles"]()
    check_chain(torch.tensor(coordinates, dtype=DOUBLE).view(-1, 3)[: topology.num_vertices], topology)


@pytest.mark.parametrize("surface", [Torus(2.0, 0.8), Catenoid(), Enneper()], ids=["torus", "catenoid", "enneper"])
def test_principal_quads_have_curvature_equal_to_their_energy(surface):
    """In the limit: the gap closes with second order. (Both leave the boundary edges out.)"""
    gaps = []
    for n in (1, 2):
        mesh = principal_quads(surface, 12 * n, 24 * n)
        gaps.append(1 - ratio(mesh.vertices, mesh.topology))
    assert gaps[-1] < 0.02
    assert gaps[-1] < 0.27 * gaps[0]


@pytest.mark.parametrize("kind", ["triangles", "split"])
@pytest.mark.parametrize("surface", [Catenoid(), Enneper(), Helicoid()], ids=["catenoid", "enneper", "helicoid"])
def test_saddles_meshed_otherwise_have_less_curvature_than_energy(surface, kind):
    for n in (10, 20):
        mesh = rotated_lattice(surface, n, 2 * n, 0.6, kind=kind)
        assert 0.5 < ratio(mesh.vertices, mesh.topology) < 0.92


@pytest.mark.parametrize("make", [parameter_quads, parameter_triangles])
def test_roughness_cancels_in_curvature_but_not_in_energy(make):
    """A plane with noise: ups and downs meet in every star."""
    mesh = make(Paraboloid(0.0, 0.0), 24, 24)
    rough = mesh.vertices.clone()
    rough[:, 2] = 0.01 * torch.randn(len(rough), dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    assert ratio(rough, mesh.topology) < 0.8
    assert corrected(rough, mesh.topology) < 0.6 * normal_variation(rough, mesh.topology)


# ---- identities, corners, kinks ------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_equals_singular_values_in_the_tangent_plane(mesh):
    operators = tangential_shape_operators(*mesh())
    expected = torch.linalg.svdvals(operators).sum(-1)
    torch.testing.assert_close(total_absolute_curvature_per_vertex(*mesh()), expected)


def test_traces_sum_to_lengths_times_sines():
    """Convex everywhere and smooth: C is the trace less what lies along the normals."""
    ball = icosphere(3)
    traces = shape_operators(ball.vertices, ball.topology).diagonal(dim1=-2, dim2=-1).sum()
    sines = dihedral_angles(ball.vertices, ball.topology).sin()
    total = (edge_lengths(ball.vertices, ball.topology) * sines).sum()
    torch.testing.assert_close(traces, total)
    value = total_absolute_curvature(ball.vertices, ball.topology)
    assert 0.99 * total < value < total
    assert 2 * total_mean_curvature(ball.vertices, ball.topology) == pytest.approx(total.item(), rel=1e-2)


def test_cube_and_prism_in_closed_form():
    """A corner of the cube keeps two of its three eigenvalues 1/2; a prism its mantle and its rims."""
    assert total_absolute_curvature(*cube()).item() == pytest.approx(8 * 2 * 0.5)
    assert with_angles(*cube()).item() == pytest.approx(8 * 2 * math.pi / 4)
    sides = 6
    value = total_absolute_curvature_per_vertex(*capped_prism(sides))
    torch.testing.assert_close(value, value[:1].expand(2 * sides))


@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
@each_method
def test_flat_meshes_have_none_and_a_finite_gradient(mesh, method):
    vertices, topology = mesh()
    variable = vertices.clone().requires_grad_()
    value = method(variable, topology)
    (gradient,) = torch.autograd.grad(value, variable)
    assert value.item() < 1e-14
    assert gradient.isfinite().all()


@each_method
def test_scale_with_lengths_and_do_not_see_the_orientation(method):
    vertices, topology = mixed_grid()
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()], topology.num_vertices)
    torch.testing.assert_close(method(3 * vertices, turned), 3 * method(vertices, topology))


def test_one_element_of_a_batch_does_not_touch_the_others():
    vertices, topology = mixed_grid()
    batch = torch.stack([vertices, torch.full_like(vertices, float("nan")), 2 * vertices])
    for method in (normal_cycle, corrected, completed):
        values = method(batch, topology)
        assert values.isnan().tolist() == [False, True, False]
        torch.testing.assert_close(values[2], method(2 * vertices, topology))


# ---- choices -------------------------------------------------------------------------------------------


def test_module_holds_its_choices():
    vertices, topology = mixed_grid()
    module = TotalAbsoluteCurvature(topology, sine=False, boundary="extrapolated")
    expected = total_absolute_curvature_per_vertex(vertices, topology, sine=False, boundary=module.extrapolation)
    torch.testing.assert_close(module.per_vertex(vertices), expected)
    assert repr(module).endswith("normal_cycle, sine=False, extrapolated boundary)")
    assert repr(TotalAbsoluteCurvature(topology, estimator="corrected")).endswith("corrected, open boundary)")


def test_boundary_makes_no_difference_without_one():
    torch.testing.assert_close(completed(*cube()), normal_cycle(*cube()))


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"estimator": "jets"}, 'estimator must be "normal_cycle" or "corrected"'),
        ({"boundary": "free"}, 'boundary must be "open" or "extrapolated"'),
    ],
)
def test_unknown_choices_are_refused(choice, message):
    vertices, topology = mixed_grid()
    with pytest.raises(TorchfairError, match=message):
        TotalAbsoluteCurvature(topology, **choice)
    with pytest.raises(TorchfairError, match=message):
        total_absolute_curvature(vertices, topology, **choice)
