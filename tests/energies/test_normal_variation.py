"""What the normal variation is: closed forms, limits on smooth surfaces, invariances, degenerate input."""

from __future__ import annotations

import itertools
import math

import hypothesis.strategies as st
import numpy as np
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
    outward_hull,
    split_faces,
    torus,
    with_isolated,
)
from helpers import DOUBLE, cube, grid_faces, random_rotation, split_quads, tetrahedron
from hypothesis import given, settings
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.energies import (
    NormalVariation,
    angle_variation_per_edge,
    normal_variation,
    normal_variation_per_edge,
)
from torchfair.geometry import dual_edge_lengths, edge_lengths, face_normals

every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC)


def sphere_hull(count: int) -> tuple[Tensor, Topology]:
    """Convex hull of ``count`` random points on the unit sphere."""
    points = np.random.default_rng(count).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return torch.from_numpy(points), Topology.from_faces(outward_hull(points))


def catenoid(rows: int, columns: int, bottom: float, top: float, angle: float) -> tuple[Tensor, Topology]:
    """Principal quads of the catenoid r = cosh z, bottom <= z <= top; closed around the axis if the angle is 2 pi."""
    closed = angle == 2 * math.pi
    z, u = np.meshgrid(np.linspace(bottom, top, rows + 1), np.linspace(0, angle, columns + 1), indexing="ij")
    points = np.stack([np.cosh(z) * np.cos(u), np.cosh(z) * np.sin(u), z], axis=-1)
    faces = grid_faces(rows + 1, columns + 1)
    if closed:
        points = points[:, :-1]
        row, column = np.divmod(faces, columns + 1)
        faces = row * columns + column % columns
    return torch.from_numpy(points.reshape(-1, 3)), Topology.from_faces(faces)


def lattice(half_edge: float, height: float, a: float, b: float) -> tuple[Tensor, Topology]:
    """Triangle lattice on z = (a x^2 + b y^2) / 2: principal edges along x, rows shifted by half an edge."""
    rows = columns = 5
    j, i = np.meshgrid(np.arange(rows) - 2, np.arange(columns) - 2, indexing="ij")
    x, y = half_edge * (2 * i + j % 2), height * j.astype(float)
    faces = []
    for r, c in itertools.product(range(rows - 1), range(columns - 1)):
        p, q = r * columns + c, (r + 1) * columns + c
        faces += [[p, p + 1, q], [p + 1, q + 1, q]] if r % 2 == 0 else [[p, p + 1, q + 1], [p, q + 1, q]]
    points = np.stack([x, y, (a * x**2 + b * y**2) / 2], axis=-1).reshape(-1, 3)
    return torch.from_numpy(points), Topology.from_faces(faces)


def orders(errors: list[float]) -> list[float]:
    """Observed orders of convergence if every step halves the cells."""
    return [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]


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


# ---- limits on smooth surfaces -------------------------------------------------------------------------------


def test_tends_to_eight_pi_r_from_below_on_inscribed_icospheres():
    errors = [8 * math.pi - normal_variation(*icosphere(level)).item() for level in (1, 2, 3)]
    assert errors[-1] > 0
    assert min(orders(errors)) > 1.9
    vertices, topology = icosphere(3)
    assert normal_variation(5 * vertices, topology).item() == pytest.approx(40 * math.pi, rel=1e-2)


def test_tends_to_eight_pi_r_on_any_convex_mesh_in_the_sphere():
    errors = [abs(normal_variation(*sphere_hull(count)).item() / (8 * math.pi) - 1) for count in (50, 200, 800, 3200)]
    assert min(orders(errors)) > 1.5  # quartered cells halve them
    assert errors[-1] < 5e-3


def test_tends_to_c_on_principal_quads_of_the_torus_with_second_order():
    big, small = 3.0, 1.0
    exact = 4 * math.pi**2 * big + 8 * math.pi * small
    sizes = [(24, 12), (48, 24), (96, 48)]
    errors = [abs(normal_variation(*torus(rows, columns, big, small)).item() - exact) for rows, columns in sizes]
    assert min(orders(errors)) > 1.9
    assert errors[-1] < 1e-3 * exact


def test_a_sheared_triangle_mesh_of_the_torus_keeps_more_than_c():
    """Its edges miss the principal directions: refinement does not bring E down to C on the saddle side."""
    exact = 12 * math.pi**2 + 8 * math.pi
    for rows, columns in [(24, 12), (48, 24), (96, 48)]:
        _, topology = torus(rows, columns)
        u, v = np.meshgrid(np.arange(rows) / rows, np.arange(columns) / columns, indexing="ij")
        around, across = 2 * math.pi * (u + v), 2 * math.pi * v  # meridians wind once around the axis
        distance = 3 + np.cos(across)
        points = np.stack([distance * np.cos(around), distance * np.sin(around), np.sin(across)], axis=-1)
        triangles = Topology.from_faces(split_quads(np.array(topology.face_lists())))
        assert normal_variation(torch.from_numpy(points.reshape(-1, 3)), triangles).item() > 1.1 * exact


@pytest.mark.parametrize("angle", [2 * math.pi, 1.5])
def test_tends_to_c_of_what_interior_edges_stand_for_on_a_catenoid_with_second_order(angle):
    """Interior edges along a boundary stand for all but half a cell beside it.

    On the catenoid each of |k1|, |k2| has the integral angle * height. Edges along parallels measure the
    curvature of meridians, and those at top and bottom are missing: half a row at either end. Edges along
    meridians measure that of parallels; the first and the last are missing if the patch is not closed.
    """
    bottom, top = -0.4, 1.2
    errors, naive = [], []
    for rows, columns in [(8, 16), (16, 32), (32, 64)]:
        value = normal_variation(*catenoid(rows, columns, bottom, top, angle)).item()
        row = (top - bottom) / rows
        column = 0 if angle == 2 * math.pi else angle / columns
        errors.append(abs(value - (angle * (top - bottom - row) + (angle - column) * (top - bottom))))
        naive.append(abs(value - 2 * angle * (top - bottom)))
    assert min(orders(errors)) > 1.9
    assert max(orders(naive)) < 1.5  # the whole patch is approached with first order only


@pytest.mark.parametrize(("a", "b", "p", "q"), [(1.0, -2.0, 1.0, 1.5), (-0.5, 3.0, 1.2, 0.7), (2.0, -1.0, 0.5, 1.0)])
def test_energy_per_area_of_principal_triangle_lattices_on_saddles(a, b, p, q):
    """|a| + |b| + 2 |a| p^2 / q^2 while |b| q^2 > |a| p^2 (two triangles of area p q at each vertex)."""
    assert abs(b) * q**2 > abs(a) * p**2
    scale = 1e-3
    vertices, topology = lattice(scale * p, scale * q, a, b)
    centre = 12
    at_centre = (topology.interior_edges == centre).any(1)
    assert at_centre.sum() == 6
    energy = normal_variation_per_edge(vertices, topology)[at_centre].sum().item() / 2
    expected = abs(a) + abs(b) + 2 * abs(a) * p**2 / q**2
    assert energy / (2 * p * q * scale**2) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("a", "b"), [(1.0, -2.0), (1.0, 2.0), (0.0, 1.0)])
def test_energy_per_area_of_principal_quads_on_paraboloids(a, b):
    scale = 1e-3
    x, y = np.meshgrid(scale * np.arange(-2, 3), 1.3 * scale * np.arange(-2, 3), indexing="ij")
    points = np.stack([x, y, (a * x**2 + b * y**2) / 2], axis=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(5, 5))
    at_centre = (topology.interior_edges == 12).any(1)
    energy = normal_variation_per_edge(torch.from_numpy(points), topology)[at_centre].sum().item() / 2
    assert energy / (1.3 * scale**2) == pytest.approx(abs(a) + abs(b), rel=1e-4)


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
