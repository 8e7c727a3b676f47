"""The gradient of the normal variation: Prop. 2 as printed, the fast path against autograd, flat edges."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, icosphere, mixed_grid
from helpers import DOUBLE, random_rotation
from hypothesis import given, settings
from normal_variation_reference import gradient_of, plain
from torch import Tensor

from torchfair import Topology
from torchfair.energies import _normal_variation_function as function_module
from torchfair.energies import normal_variation

every_degenerate_mesh = pytest.mark.parametrize("mesh", DEGENERATE.values(), ids=DEGENERATE)


def dented_sphere() -> tuple[Tensor, Topology]:
    """Closed triangle mesh with convex and concave edges."""
    vertices, topology = icosphere(1)
    noise = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    return vertices + 0.15 * noise, topology


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
