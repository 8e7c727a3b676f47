"""Reflection variation of distant views: what the mirror shows, its mean over the sphere, and its derivatives."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from geometry_meshes import GENERIC, collinear_face, flat_pair, flat_squares, icosphere, random_polytope, torus
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid
from hypothesis import given, settings

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.energies import normal_variation, normal_variation_per_edge
from torchfair.geometry import dihedral_angles, edge_lengths, face_normals
from torchfair.reflection import (
    ReflectionVariation,
    axis_directions,
    reflection_variation,
    reflection_variation_per_edge,
)

FORMS = ("sine", "dual")
each_form = pytest.mark.parametrize("form", FORMS)


def directions(count: int, seed: int = 0) -> torch.Tensor:
    rows = torch.from_numpy(np.random.default_rng(seed).normal(size=(count, 3)))
    return rows / rows.norm(dim=-1, keepdim=True)


def mirror(d: torch.Tensor, n: torch.Tensor) -> torch.Tensor:
    return d - 2 * (d * n).sum(-1, keepdim=True) * n


# ---- what it means -------------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [*GENERIC.values(), cube, tetrahedron], ids=[*GENERIC, "cube", "tetrahedron"])
def test_is_jump_of_the_mirrored_direction_times_length_in_the_picture(mesh):
    vertices, topology = mesh()
    views, normals = directions(5), face_normals(vertices, topology)
    left, right = normals[topology.interior_edge_faces].unbind(1)
    v, w = vertices[topology.interior_edges].unbind(1)
    for d, terms in zip(views, reflection_variation_per_edge(vertices, topology, views), strict=True):
        jump = (mirror(d, left) - mirror(d, right)).norm(dim=-1)
        on_screen = (w - v) - ((w - v) @ d)[:, None] * d
        torch.testing.assert_close(terms, jump * on_screen.norm(dim=-1), rtol=1e-11, atol=1e-13)


def test_jump_of_planar_faces_is_twice_the_sine_of_the_dihedral_angle_times_that_of_the_view():
    vertices, topology = random_polytope(4)
    views = directions(6)
    edges = vertices[topology.interior_edges].diff(dim=1).squeeze(1)
    lengths = edge_lengths(vertices, topology)
    sine = torch.linalg.cross(views[:, None], (edges / lengths[:, None])[None]).norm(dim=-1)
    expected = 2 * dihedral_angles(vertices, topology).sin().abs() * sine**2 * lengths
    torch.testing.assert_close(reflection_variation_per_edge(vertices, topology, views), expected)


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC)
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_mean_over_any_octahedron_of_views_is_four_thirds_of_the_energy(mesh, seed):
    vertices, topology = mesh()
    views = axis_directions() if seed is None else axis_directions() @ random_rotation(seed).T
    for chosen in (views, views[:3]):  # d and -d see the same
        mean = reflection_variation(vertices, topology, chosen, form="dual").mean(-1)
        torch.testing.assert_close(mean, 4 / 3 * normal_variation(vertices, topology), rtol=1e-12, atol=0)
    per_edge = reflection_variation_per_edge(vertices, topology, views, form="dual").mean(-2)
    torch.testing.assert_close(per_edge, 4 / 3 * normal_variation_per_edge(vertices, topology), rtol=1e-12, atol=1e-15)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_mean_of_the_sine_form_over_any_octahedron_is_four_thirds_of_the_sum_of_sines(seed):
    vertices, topology = random_polytope(seed)
    sines = edge_lengths(vertices, topology) * dihedral_angles(vertices, topology).sin().abs()
    mean = reflection_variation(vertices, topology, axis_directions() @ random_rotation(seed).T).mean(-1)
    torch.testing.assert_close(mean, 4 / 3 * sines.sum(-1), rtol=1e-12, atol=0)


def test_mean_over_the_whole_sphere_by_sampling():
    vertices, topology = wavy_grid(triangles=True)
    sines = edge_lengths(vertices, topology)[: topology.num_interior_edges]
    sines = (sines * dihedral_angles(vertices, topology).sin().abs()).sum()
    values = reflection_variation(vertices, topology, directions(4000))
    error = values.std() / 4000**0.5
    assert (values.mean() - 4 / 3 * sines).abs() < 4 * error
    assert error < 0.01 * sines


def test_both_forms_agree_to_third_order_in_the_angle():
    differences = []
    for height in (0.2, 0.1, 0.05):
        vertices, topology = flat_pair()
        vertices[:, 2] += height * (vertices[:, 1] > 0)
        sine, dual = (reflection_variation(vertices, topology, form=form).sum() for form in FORMS)
        differences.append((dual - sine).item())
    ratios = np.array(differences[:-1]) / differences[1:]
    assert (ratios > 2**2.9).all()
    assert (ratios < 2**3.1).all()


def test_sine_forgets_sharp_edges_and_dual_does_not():
    """A mirror does not see the sign of its normal: folded faces look like one plane."""
    topology = Topology.from_faces([[0, 1, 2], [1, 0, 3]])

    def pair(angle: float) -> torch.Tensor:
        return torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -np.cos(angle), np.sin(angle)]], dtype=DOUBLE)

    values = {form: [reflection_variation(pair(a), topology, form=form).mean().item() for a in (0.5, 1.5, 2.5, 3.1)]
              for form in FORMS}  # fmt: skip
    assert values["sine"][3] < values["sine"][0] < values["sine"][1]
    assert values["dual"] == sorted(values["dual"])


# ---- invariance ----------------------------------------------------------------------------------------


@each_form
def test_moves_with_the_views_scales_and_ignores_orientation_and_numbering(form):
    vertices, topology = GENERIC["mixed"]()
    views = directions(4)
    value = reflection_variation(vertices, topology, views, form=form)
    turn = random_rotation(3)
    moved = reflection_variation(3 * vertices @ turn.T + 5, topology, 2 * views @ turn.T, form=form)
    torch.testing.assert_close(moved, 3 * value)
    torch.testing.assert_close(reflection_variation(vertices, topology, -views, form=form), value)
    faces = topology.face_lists()
    reversed_faces = Topology.from_faces([face[::-1] for face in faces], topology.num_vertices)
    torch.testing.assert_close(reflection_variation(vertices, reversed_faces, views, form=form), value)
    order = torch.randperm(topology.num_vertices, generator=torch.Generator().manual_seed(0))
    place = order.argsort()
    renumbered = Topology.from_faces([[int(place[v]) for v in face] for face in faces[::-1]], topology.num_vertices)
    torch.testing.assert_close(reflection_variation(vertices[order], renumbered, views, form=form), value)


@each_form
def test_planar_polygons_do_not_see_their_diagonals(form):
    vertices, topology = cube()
    triangles = Topology.from_faces([t for a, b, c, d in topology.face_lists() for t in ([a, b, c], [a, c, d])])
    views = directions(5)
    torch.testing.assert_close(
        reflection_variation(vertices, topology, views, form=form),
        reflection_variation(vertices, triangles, views, form=form),
    )


@each_form
def test_batch_vmap_and_precision(form):
    vertices, topology = wavy_grid(triangles=True)
    batch = torch.stack([vertices, 2 * vertices, vertices.flip(-1)]).view(3, 1, -1, 3)
    views = directions(4)
    together = reflection_variation(batch, topology, views, form=form)
    assert together.shape == (3, 1, 4)
    for one, mesh in zip(together[:, 0], batch[:, 0], strict=True):
        torch.testing.assert_close(one, reflection_variation(mesh, topology, views, form=form))
    mapped = torch.vmap(lambda v: reflection_variation(v, topology, views, form=form))(batch[:, 0])
    torch.testing.assert_close(mapped, together[:, 0])
    own_views = torch.stack([views, views.flip(0), views.roll(1, -1)])
    own = reflection_variation(batch[:, 0], topology, own_views, form=form)
    torch.testing.assert_close(own[1], together[1, 0].flip(0))
    single = reflection_variation(vertices.float(), topology, views, form=form)
    assert single.dtype == torch.float32
    torch.testing.assert_close(single.double(), together[0, 0], rtol=1e-5, atol=1e-5)


# ---- derivatives ---------------------------------------------------------------------------------------


@each_form
@pytest.mark.parametrize(
    "mesh", [lambda: wavy_grid(3, 3, triangles=True), lambda: wavy_grid(3, 3), lambda: torus(4, 3)]
)
def test_gradcheck(form, mesh):
    vertices, topology = mesh()
    views = directions(2)
    function = lambda v, d: reflection_variation(v, topology, d, form=form)  # noqa: E731
    inputs = (vertices.requires_grad_(), views.requires_grad_())
    assert torch.autograd.gradcheck(function, inputs, check_forward_ad=True)
    assert torch.autograd.gradgradcheck(function, inputs)


@each_form
@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
def test_flat_meshes_have_value_and_derivatives_zero(form, mesh):
    vertices, topology = mesh()
    for views in (directions(3), axis_directions()):
        assert not reflection_variation(vertices, topology, views, form=form).any()
        for derivative in (torch.func.jacrev, torch.func.jacfwd):
            slope = derivative(lambda v: reflection_variation(v, topology, views, form=form))(vertices)  # noqa: B023
            assert not slope.any()


@each_form
def test_edges_along_the_view_have_value_zero_and_the_right_derivative(form):
    vertices, topology = flat_pair()
    vertices = vertices + torch.tensor([0, 0, 0.3], dtype=DOUBLE) * (vertices[:, 1:2] > 0)
    v, w = vertices[topology.interior_edges[0]]
    view = (w - v)[None]
    function = lambda x: reflection_variation(x, topology, view, form=form)  # noqa: E731
    assert function(vertices).item() == pytest.approx(0, abs=1e-30)
    for derivative in (torch.func.jacrev, torch.func.jacfwd):
        assert derivative(function)(vertices).abs().max() < 1e-14
    step = torch.zeros_like(vertices)
    step[topology.interior_edges[0, 0], 2] = 1e-5  # quadratic: difference quotients tend to zero as well
    assert function(vertices + step).item() < 1e-8


@each_form
def test_faces_without_area_edges_without_length_and_views_without_direction_add_nothing(form):
    vertices, topology = collinear_face()
    views = torch.cat([directions(3), torch.zeros(1, 3, dtype=DOUBLE)])
    terms = reflection_variation_per_edge(vertices, topology, views, form=form)
    beside = (topology.interior_edge_faces == 2).any(1)
    assert not terms[:, beside].any()
    assert not terms[3].any()
    assert (terms[:3, ~beside] > 0).all()
    collapsed = torch.zeros_like(vertices)
    for mesh in (vertices, collapsed):
        for derivative in (torch.func.jacrev, torch.func.jacfwd):
            slope = derivative(lambda v: reflection_variation(v, topology, views, form=form))(mesh)
            assert torch.isfinite(slope).all()
    assert not reflection_variation(collapsed, topology, views, form=form).any()


def test_without_interior_edges_the_value_is_zero_and_depends_on_the_vertices():
    vertices = torch.eye(3, dtype=DOUBLE, requires_grad=True)
    value = reflection_variation(vertices, Topology.from_faces([[0, 1, 2]]))
    assert value.shape == (6,)
    assert not value.any()
    value.sum().backward()


# ---- weights, module, errors ---------------------------------------------------------------------------


@each_form
def test_module_is_the_mean_over_the_views_and_visibility_weighs_the_terms(form):
    vertices, topology = wavy_grid()
    views = directions(5)
    shares = torch.rand(5, topology.num_interior_edges, generator=torch.Generator().manual_seed(0))
    terms = reflection_variation_per_edge(vertices, topology, views, form=form) * shares
    module = ReflectionVariation(topology, views, form=form, visibility=shares)
    torch.testing.assert_close(module(vertices), terms.sum(-1).mean(-1))
    torch.testing.assert_close(module.per_edge(vertices), terms.mean(-2))
    torch.testing.assert_close(
        reflection_variation(vertices, topology, views, form=form, visibility=shares), terms.sum(-1)
    )
    assert set(module.state_dict()) == {"directions", "visibility"}
    assert form in repr(module)


def test_module_by_default_is_four_thirds_of_the_energy_of_a_sphere():
    """E of inscribed convex meshes tends to 8 pi."""
    vertices, topology = icosphere(3)
    value = ReflectionVariation(topology)(vertices)
    torch.testing.assert_close(value, 4 / 3 * normal_variation(vertices, topology), rtol=1e-12, atol=0)
    assert value.item() == pytest.approx(4 / 3 * 8 * np.pi, rel=0.01)


def test_wrong_arguments_are_named():
    vertices, topology = wavy_grid()
    with pytest.raises(ShapeError, match="directions"):
        reflection_variation(vertices, topology, torch.ones(3))
    with pytest.raises(ShapeError, match="directions"):
        reflection_variation(vertices, topology, [[1.0, 0, 0]])
    with pytest.raises(ShapeError, match="visibility"):
        reflection_variation(vertices, topology, visibility=torch.ones(3))
    with pytest.raises(ShapeError, match="vertices"):
        reflection_variation(vertices[1:], topology)
    with pytest.raises(TorchfairError, match="form must be"):
        reflection_variation(vertices, topology, form="cosine")
    with pytest.raises(TorchfairError, match="form must be"):
        ReflectionVariation(topology, form="cosine")


def test_compiles_to_one_graph():
    vertices, topology = wavy_grid(4, 4)
    for form in FORMS:
        module = ReflectionVariation(topology, form=form)
        compiled = torch.compile(module, fullgraph=True, backend="eager")
        torch.testing.assert_close(compiled(vertices), module(vertices))
