"""The one-sided derivative of the normal variation: Prop. 3 and ideal case II of the paper."""

from __future__ import annotations

import math

import hypothesis.strategies as st
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, collinear_face, flat_pair, flat_squares, mixed_grid, split_faces
from helpers import DOUBLE, cube, grid_faces, random_rotation, split_quads
from hypothesis import assume, given, settings
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.energies import normal_variation
from torchfair.energies.normal_variation_derivative import normal_variation_derivative
from torchfair.geometry import face_areas, face_normals

coordinate = st.floats(-2, 2)
triple = st.tuples(coordinate, coordinate, coordinate)


def noise(like: Tensor, seed: int = 0) -> Tensor:
    return torch.randn(like.shape, dtype=like.dtype, generator=torch.Generator().manual_seed(seed))


def folded_sheet() -> tuple[Tensor, Topology]:
    """A triangulated strip in two planes: flat edges in both, bent ones between, boundary around."""
    topology = Topology.from_faces(split_quads(grid_faces(5, 4)))
    x, y = torch.meshgrid(torch.arange(5.0, dtype=DOUBLE), torch.arange(4.0, dtype=DOUBLE), indexing="ij")
    x = x + 0.2 * y
    return torch.stack([x, y + 0.1 * x, 0.75 * (x - 0.2 * y - 2).clamp(min=0)], dim=-1).view(-1, 3), topology


PARTLY_FLAT = {
    "flat triangles": flat_pair,
    "flat squares": flat_squares,
    "split cube": lambda: split_faces(cube()),
    "folded sheet": folded_sheet,
}
every_partly_flat_mesh = pytest.mark.parametrize("mesh", PARTLY_FLAT.values(), ids=PARTLY_FLAT)
every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC)


@every_partly_flat_mesh
@pytest.mark.parametrize("seed", range(3))
def test_finite_differences_with_positive_steps_tend_to_it_with_first_order(mesh, seed):
    vertices, topology = mesh()
    velocity = noise(vertices, seed)
    derivative = normal_variation_derivative(vertices, velocity, topology).item()
    start = normal_variation(vertices, topology).item()
    steps = [1e-2, 1e-3, 1e-4, 1e-5]
    errors = [(normal_variation(vertices + t * velocity, topology).item() - start) / t - derivative for t in steps]
    rates = [error / t for error, t in zip(errors, steps, strict=True)]
    assert rates[1] == pytest.approx(rates[-1], rel=0.2)
    assert abs(errors[-1]) < 1e-3


@every_mesh
def test_is_gradient_times_velocity_where_no_edge_is_flat(mesh):
    vertices, topology = mesh()
    velocity = noise(vertices)
    gradient = torch.func.grad(normal_variation)(vertices, topology)
    expected = (gradient * velocity).sum()
    torch.testing.assert_close(normal_variation_derivative(vertices, velocity, topology), expected)
    torch.testing.assert_close(normal_variation_derivative(vertices, -velocity, topology), -expected)


def test_is_gradient_times_velocity_at_slightly_bent_edges():
    """Not flat: the sign of a bend far above the rounding of coordinates counts."""
    vertices, topology = flat_pair()
    for bend in (1e-9, -1e-9):
        bent = vertices.clone()
        bent[2, 2] = bend
        velocity = torch.zeros_like(bent)
        velocity[2, 2] = 1
        expected = (torch.func.grad(normal_variation)(bent, topology) * velocity).sum()
        assert expected.item() == pytest.approx(math.copysign(2, bend))
        torch.testing.assert_close(normal_variation_derivative(bent, velocity, topology), expected)


@every_partly_flat_mesh
def test_equals_the_gradient_with_the_limit_of_proposition_three(mesh):
    """Prop. 3: at flat edges (n' - n) / l* is plus or minus the unit conormal of the edge, by the way it will bend.

    The energy is split: bent edges have a gradient, flat ones get the limit as a fixed covector on n' - n.
    """
    vertices, topology = mesh()
    velocity = noise(vertices, 5)
    later = vertices + 1e-5 * velocity
    total = 0.0
    left, right = topology.interior_edge_faces.unbind(1)
    ends = topology.interior_edges

    def jumps(points: Tensor) -> Tensor:
        normals = face_normals(points, topology)
        return normals[right] - normals[left]

    def lengths(points: Tensor) -> Tensor:
        return (points[ends[:, 1]] - points[ends[:, 0]]).norm(dim=-1)

    normals, side = face_normals(vertices, topology), vertices[ends[:, 1]] - vertices[ends[:, 0]]
    conormal = torch.linalg.cross(side, normals[left])  # from the left face to the right one
    conormal = conormal / conormal.norm(dim=-1, keepdim=True)
    flat = jumps(vertices).norm(dim=-1) < 1e-12
    sign = torch.sign((jumps(later) * conormal).sum(-1))
    direction = torch.where(flat[:, None], sign[:, None] * conormal, 0.0)

    def energy(points: Tensor) -> Tensor:
        bent = torch.where(flat, 0.0, torch.where(flat[:, None], 1.0, jumps(points)).norm(dim=-1))
        return (lengths(points) * (bent + (direction * jumps(points)).sum(-1))).sum()

    assert flat.any()
    total = (torch.func.grad(energy)(vertices) * velocity).sum()
    if topology.is_triangular:
        torch.testing.assert_close(normal_variation_derivative(vertices, velocity, topology), total)
    else:  # normals of polygons that cease to be planar move along the edge too: |d.| is larger
        assert normal_variation_derivative(vertices, velocity, topology).item() > total.item()


# ---- parallelograms --------------------------------------------------------------------------------------------


@settings(max_examples=50, deadline=None)
@given(corner=triple, u=triple, v=triple, seed=st.integers(0, 10**6))
def test_bending_a_parallelogram_along_its_diagonal_costs(corner, u, v, seed):
    """Ideal case II: l^2 |n . (a1 + a3 - a0 - a2)| / (2 |f|), positive unless the four corners stay in a plane."""
    corner, u, v = (torch.tensor(x, dtype=DOUBLE) for x in (corner, u, v))
    assume(torch.linalg.cross(u, v).norm() > 1e-2)
    vertices = torch.stack([corner, corner + u, corner + u + v, corner + v])
    topology = Topology.from_faces([[0, 1, 2], [0, 2, 3]])
    velocity = noise(vertices, seed)
    normal, area = face_normals(vertices, topology)[0], face_areas(vertices, topology)[0]
    bending = (normal @ (velocity[1] + velocity[3] - velocity[0] - velocity[2])).item()
    expected = (u + v).norm().item() ** 2 * abs(bending) / (2 * area.item())
    value = normal_variation_derivative(vertices, velocity, topology).item()
    assert value == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert value > 0
    assert normal_variation_derivative(vertices, -velocity, topology).item() == pytest.approx(value)


def test_moving_a_planar_mesh_within_its_plane_or_rigidly_costs_nothing():
    vertices, topology = folded_sheet()
    planar = vertices * torch.tensor([1.0, 1, 0], dtype=DOUBLE)
    in_plane = noise(planar) * torch.tensor([1.0, 1, 0], dtype=DOUBLE)
    assert normal_variation_derivative(planar, in_plane, topology).item() == 0
    axis = torch.tensor([0.3, -0.5, 0.8], dtype=DOUBLE)
    turning = torch.linalg.cross(axis.expand_as(vertices), vertices) + axis
    assert normal_variation_derivative(vertices, turning, topology).item() == pytest.approx(0, abs=1e-12)
    growing = normal_variation_derivative(vertices, vertices, topology)
    torch.testing.assert_close(growing, normal_variation(vertices, topology))


# ---- deciding what is flat -------------------------------------------------------------------------------------


@every_partly_flat_mesh
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("dtype", "far", "digits"), [(DOUBLE, 1e4, 1e-10), (torch.float32, 10.0, 1e-3)])
def test_rigid_motion_does_not_unflatten_edges(mesh, seed, dtype, far, digits):
    """Rotated coordinates are rounded, so that normals of coplanar faces differ a little."""
    vertices, topology = mesh()
    rotation = random_rotation(seed)
    velocity = noise(vertices, seed)
    moved = vertices @ rotation.T + far * noise(torch.zeros(3, dtype=DOUBLE), seed)
    value = normal_variation_derivative(moved.to(dtype), (velocity @ rotation.T).to(dtype), topology)
    expected = normal_variation_derivative(vertices, velocity, topology).item()
    assert value.item() == pytest.approx(expected, rel=digits)


# ---- laws ------------------------------------------------------------------------------------------------------


@every_partly_flat_mesh
def test_is_positively_homogeneous_and_subadditive(mesh):
    vertices, topology = mesh()
    a, b = noise(vertices, 1), noise(vertices, 2)

    def rate(velocity: Tensor) -> float:
        return normal_variation_derivative(vertices, velocity, topology).item()

    assert rate(3 * a) == pytest.approx(3 * rate(a))
    assert rate(0 * a) == 0
    assert rate(a) + rate(-a) > 0.1  # a kink that opens upwards
    assert rate(a + b) <= rate(a) + rate(b) + 1e-12


def test_weights_and_batches():
    vertices, topology = folded_sheet()
    batch = torch.stack([vertices, vertices @ random_rotation(1).T])
    velocity = noise(batch)
    weights = torch.linspace(-1, 2, topology.num_interior_edges, dtype=DOUBLE)
    values = normal_variation_derivative(batch, velocity, topology, weights)
    loop = [normal_variation_derivative(v, a, topology, weights) for v, a in zip(batch, velocity, strict=True)]
    torch.testing.assert_close(values, torch.stack(loop))
    assert normal_variation_derivative(vertices, velocity, topology).shape == (2,)
    terms = [
        normal_variation_derivative(vertices, velocity[0], topology, unit)
        for unit in torch.eye(topology.num_interior_edges, dtype=DOUBLE)
    ]
    torch.testing.assert_close(torch.stack(terms) @ weights, values[0])
    mapped = torch.func.vmap(lambda v, a: normal_variation_derivative(v, a, topology, weights))(batch, velocity)
    torch.testing.assert_close(mapped, values)


@pytest.mark.parametrize("mesh", DEGENERATE.values(), ids=DEGENERATE)
@pytest.mark.parametrize("dtype", [torch.float32, DOUBLE])
def test_finite_on_degenerate_meshes_with_finite_slopes(mesh, dtype):
    vertices, topology = mesh()
    vertices = vertices.to(dtype)
    velocity = noise(vertices).requires_grad_()
    variable = vertices.clone().requires_grad_()
    value = normal_variation_derivative(variable, velocity, topology)
    assert value.dtype == dtype
    assert value.isfinite()
    for slope in torch.autograd.grad(value, (variable, velocity), materialize_grads=True):
        assert slope.isfinite().all()


def test_edges_on_the_boundary_or_beside_a_face_without_area_carry_nothing():
    vertices, topology = collinear_face()
    velocity = noise(vertices)
    pair = Topology.from_faces(topology.face_lists()[:2], topology.num_vertices)
    expected = normal_variation_derivative(vertices, velocity, pair)
    torch.testing.assert_close(normal_variation_derivative(vertices, velocity, topology), expected)
    alone = Topology.from_faces(topology.face_lists()[:1], topology.num_vertices)
    assert normal_variation_derivative(vertices, velocity, alone).item() == 0


def test_edges_of_length_zero_grow_whichever_way_their_ends_part():
    """A pentagon and a quad that share a side whose ends coincide, at an angle to each other."""
    points = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 0], [0, 1, 1], [-1, 1, 1]]
    vertices = torch.tensor(points, dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2, 3, 4], [4, 3, 5, 6]])
    assert topology.num_interior_edges == 1
    velocity = torch.zeros_like(vertices)
    velocity[3, 0] = 1
    start = normal_variation(vertices, topology).item()
    for side in (-1, 1):
        derivative = normal_variation_derivative(vertices, side * velocity, topology).item()
        step = (normal_variation(vertices + side * 1e-6 * velocity, topology).item() - start) / 1e-6
        assert derivative == pytest.approx(math.sqrt(2))
        assert step == pytest.approx(derivative, rel=1e-5)


def test_refuses_wrong_shapes():
    vertices, topology = mixed_grid()
    with pytest.raises(ShapeError, match="vertices: expected a floating tensor"):
        normal_variation_derivative(vertices[:, :2], vertices, topology)
    for wrong in (vertices[:3], [1.0]):
        with pytest.raises(ShapeError, match=r"velocity: expected a floating tensor \(\*batch, 25, 3\)"):
            normal_variation_derivative(vertices, wrong, topology)
    with pytest.raises(ShapeError, match="edge_weights: expected"):
        normal_variation_derivative(vertices, vertices, topology, torch.ones(3))
