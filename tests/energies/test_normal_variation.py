"""What the normal variation is: closed forms, invariances, degenerate input, batches."""

from __future__ import annotations

import math

import hypothesis.strategies as st
import pytest
import torch
from geometry_meshes import (
    GENERIC,
    capped_prism,
    collinear_face,
    flat_pair,
    flat_squares,
    icosphere,
    mixed_grid,
    split_faces,
    with_isolated,
)
from helpers import DOUBLE, cube, random_rotation, tetrahedron
from hypothesis import given, settings

from torchfair import ShapeError, Topology
from torchfair.energies import (
    NormalVariation,
    angle_variation_per_edge,
    normal_variation,
    normal_variation_per_edge,
)
from torchfair.geometry import dual_edge_lengths, edge_lengths, face_normals

every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC)


# ---- closed forms ------------------------------------------------------------------------------------------


def test_unit_cube_and_boxes_however_their_faces_are_cut():
    vertices, topology = cube()
    assert normal_variation(vertices, topology).item() == pytest.approx(12 * math.sqrt(2), rel=1e-15)
    box = vertices * torch.tensor([2.0, 3, 5], dtype=DOUBLE)
    for seed in range(3):
        value = normal_variation(*split_faces((box, topology), seed)).item()
        assert value == pytest.approx(4 * (2 + 3 + 5) * math.sqrt(2), rel=1e-15)


def test_regular_tetrahedron():
    """Normals at cosine -1/3."""
    expected = 6 * 2 * math.sqrt(2) * math.sqrt(8 / 3)
    assert normal_variation(*tetrahedron()).item() == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("sides", [3, 4, 7, 64])
def test_prisms(sides):
    """Dual edges are chords: of pi/2 on the rims, of 2 pi / sides beside them."""
    radius, height = 1.5, 3.0
    chord = 2 * math.sin(math.pi / sides)
    expected = sides * height * chord + 2 * sides * radius * chord * math.sqrt(2)
    assert normal_variation(*capped_prism(sides, radius, height)).item() == pytest.approx(expected, rel=1e-14)


def test_folded_edge_counts_twice_its_length():
    """Two triangles on top of each other: opposite normals, l* = 2 on all three edges."""
    vertices = torch.tensor([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]], dtype=DOUBLE)
    pillow = Topology.from_faces([[0, 1, 2], [0, 2, 1]])
    assert normal_variation(vertices, pillow).item() == pytest.approx(2 * (3 + 4 + 5))


@every_mesh
def test_is_the_sum_of_lengths_times_distances_of_normals(mesh):
    vertices, topology = mesh()
    normals = face_normals(vertices, topology)
    terms = []
    for (v, w), (f, g) in zip(topology.interior_edges.tolist(), topology.interior_edge_faces.tolist(), strict=True):
        terms.append(math.dist(vertices[v].tolist(), vertices[w].tolist()) * (normals[f] - normals[g]).norm().item())
    assert normal_variation_per_edge(vertices, topology).tolist() == pytest.approx(terms)
    assert normal_variation(vertices, topology).item() == pytest.approx(sum(terms), rel=1e-13)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(0.01, 3))
def test_is_never_larger_than_the_angle_variation_edge_by_edge(seed, size):
    """Chords of angles: 2/pi |a| <= l* <= |a|."""
    vertices, topology = mixed_grid()
    noise = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
    vertices = vertices + size * noise
    terms, arcs = normal_variation_per_edge(vertices, topology), angle_variation_per_edge(vertices, topology)
    assert (terms <= arcs * (1 + 1e-12)).all()
    assert (terms >= arcs * 2 / math.pi * (1 - 1e-12)).all()
    assert 0 < normal_variation(vertices, topology).item() < arcs.sum().item()


# ---- invariances ---------------------------------------------------------------------------------------------


@every_mesh
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(1e-3, 1e3))
def test_scales_and_ignores_rigid_motion_labels_and_orientation(mesh, seed, scale):
    vertices, topology = mesh()
    value = normal_variation(vertices, topology)
    generator = torch.Generator().manual_seed(seed)
    shift = torch.randn(3, dtype=DOUBLE, generator=generator)
    moved = scale * (vertices @ random_rotation(seed).T + shift)
    torch.testing.assert_close(normal_variation(moved, topology), scale * value, rtol=1e-11, atol=0)

    order = torch.randperm(topology.num_vertices, generator=generator)
    faces = topology.face_lists()
    shuffled = [faces[f] for f in torch.randperm(topology.num_faces, generator=generator)]
    new = order.argsort().tolist()
    relabelled = Topology.from_faces([[new[v] for v in face[1:] + face[:1]] for face in shuffled])
    torch.testing.assert_close(normal_variation(vertices[order], relabelled), value, rtol=1e-12, atol=0)
    turned = Topology.from_faces([face[::-1] for face in faces])
    torch.testing.assert_close(normal_variation(vertices, turned), value, rtol=1e-12, atol=0)


def test_digits_survive_far_from_the_origin():
    vertices, topology = icosphere(2)
    vertices = (vertices * 1024).round() / 1024
    value = normal_variation(vertices, topology).item()
    assert normal_variation(vertices + 2.0**20, topology).item() == pytest.approx(value, rel=1e-13)


@every_mesh
def test_single_precision_is_as_good_as_it_can_be(mesh):
    vertices, topology = mesh()
    value = normal_variation(vertices.float(), topology)
    assert value.dtype == torch.float32
    assert value.item() == pytest.approx(normal_variation(vertices, topology).item(), rel=2e-6)


# ---- degenerate input ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
def test_flat_edges_have_value_and_subgradient_zero_and_a_kink(mesh):
    vertices, topology = mesh()
    length = 2.0 if mesh is flat_pair else 1.0
    variable = vertices.clone().requires_grad_()
    value = normal_variation(variable, topology)
    assert value.item() == 0
    assert not torch.autograd.grad(value, variable)[0].any()
    left = (vertices[:, 1] > 0).to(DOUBLE)
    for side in (-1, 1):
        bent = vertices.clone()
        bent[:, 2] = side * 1e-8 * left
        bent.requires_grad_()
        (gradient,) = torch.autograd.grad(normal_variation(bent, topology), bent)
        assert (gradient[:, 2] @ left).item() == pytest.approx(side * length, rel=1e-6)


def test_boundary_edges_carry_nothing():
    vertices, topology = mixed_grid()
    alone = Topology.from_faces(topology.face_lists()[:1], topology.num_vertices)
    assert normal_variation(vertices, alone).item() == 0
    assert normal_variation_per_edge(vertices, alone).shape == (0,)
    assert normal_variation_per_edge(vertices, topology).shape == (topology.num_interior_edges,)


def test_edges_beside_a_face_without_area_carry_nothing():
    vertices, topology = collinear_face()
    terms = normal_variation_per_edge(vertices, topology)
    beside = (topology.interior_edge_faces == 2).any(1)
    assert beside.sum() == 1
    assert not terms[beside].any()
    variable = vertices.clone().requires_grad_()
    value = normal_variation(variable, topology)
    pair = Topology.from_faces(topology.face_lists()[:2], topology.num_vertices)
    assert value.item() == pytest.approx(normal_variation(vertices, pair).item(), rel=1e-15)
    assert value.item() > 0.1
    (gradient,) = torch.autograd.grad(value, variable)
    assert not gradient[4].any()


def test_isolated_vertices_and_empty_meshes():
    vertices, topology = with_isolated(mixed_grid())
    variable = vertices.clone().requires_grad_()
    value = normal_variation(variable, topology)
    torch.testing.assert_close(value.detach(), normal_variation(*mixed_grid()))
    assert not torch.autograd.grad(value, variable)[0][-1].any()
    nothing = Topology.from_faces([], num_vertices=3)
    variable = torch.ones(3, 3, requires_grad=True)
    value = normal_variation(variable, nothing)
    assert value.item() == 0
    assert not torch.autograd.grad(value, variable)[0].any()
    assert normal_variation(torch.ones(0, 3), Topology.from_faces([], num_vertices=0)).item() == 0


# ---- batches, weights, module ------------------------------------------------------------------------------------


@every_mesh
def test_batches_equal_loops(mesh):
    vertices, topology = mesh()
    batch = torch.stack([vertices * s + 0.1 * s**2 * vertices.roll(1, 0) for s in range(1, 7)]).unflatten(0, (2, 3))
    value = normal_variation(batch, topology)
    assert value.shape == (2, 3)
    loop = torch.stack([torch.stack([normal_variation(v, topology) for v in row]) for row in batch])
    torch.testing.assert_close(value, loop, rtol=1e-13, atol=0)
    torch.testing.assert_close(normal_variation_per_edge(batch, topology).sum(-1), value)
    assert normal_variation(batch[:0], topology).shape == (0, 3)
    torch.testing.assert_close(
        normal_variation(vertices.expand(4, -1, -1), topology)[3], normal_variation(vertices, topology)
    )


@every_mesh
def test_weights_multiply_the_terms(mesh):
    vertices, topology = mesh()
    weights = torch.linspace(-1, 2, 3 * topology.num_interior_edges, dtype=DOUBLE).view(3, -1)
    lengths = edge_lengths(vertices, topology)[: topology.num_interior_edges]
    terms = lengths * dual_edge_lengths(vertices, topology)
    torch.testing.assert_close(normal_variation_per_edge(vertices, topology, weights[0]), weights[0] * terms)
    torch.testing.assert_close(normal_variation(vertices, topology, weights[1]), weights[1] @ terms)
    torch.testing.assert_close(normal_variation(vertices, topology, weights), weights @ terms)
    torch.testing.assert_close(normal_variation(vertices.expand(2, 3, -1, -1), topology, weights)[1], weights @ terms)
    assert normal_variation(vertices.float(), topology, weights[0]).dtype == torch.float32


def test_module_equals_function_and_keeps_its_weights():
    vertices, topology = mixed_grid()
    weights = torch.rand(topology.num_interior_edges, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    module = NormalVariation(topology, weights)
    torch.testing.assert_close(module(vertices), normal_variation(vertices, topology, weights))
    torch.testing.assert_close(module.per_edge(vertices), normal_variation_per_edge(vertices, topology, weights))
    other = NormalVariation(topology, torch.ones_like(weights))
    torch.testing.assert_close(other(vertices), NormalVariation(topology)(vertices))
    other.load_state_dict(module.state_dict())
    assert other(vertices).item() == module(vertices).item()
    assert not NormalVariation(topology).state_dict()


def test_refuses_wrong_shapes():
    vertices, topology = mixed_grid()
    with pytest.raises(ShapeError, match=r"vertices: expected a floating tensor \(\*batch, 25, 3\), got \(25, 2\)"):
        normal_variation(vertices[:, :2], topology)
    for function in (normal_variation, normal_variation_per_edge):
        with pytest.raises(ShapeError, match="edge_weights: expected"):
            function(vertices, topology, torch.ones(3))
