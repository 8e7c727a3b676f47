"""The terms that lower E: residuals against l l*, closed gradient against autograd."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation, tetrahedron, wavy_grid
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from torch import Tensor

from torchfair.constraints import normal_variation_terms
from torchfair.constraints.normal_variation import triangle_pair_bend, triangle_pair_bend_gradient
from torchfair.geometry import dual_edge_lengths, edge_lengths


def folded_pair(angle: float, length: float = 1.3) -> Tensor:
    """Two triangles over an edge on the x-axis, turned about it by the dihedral ``angle`` (+ convex)."""
    left, right = (0.4, 0.9), (0.8, 1.1)
    half = 0.5 * angle
    return torch.tensor(
        [
            [0.0, 0.0, 0.0],
            [length, 0.0, 0.0],
            [left[0], left[1] * math.cos(half), -left[1] * math.sin(half)],
            [right[0], -right[1] * math.cos(half), -right[1] * math.sin(half)],
        ],
        dtype=DOUBLE,
    ) @ random_rotation(3).T + torch.tensor([0.3, -0.2, 0.7], dtype=DOUBLE)


ANGLES = {
    "flat": 0.0,
    "nearly flat": 1e-9,
    "convex": 0.7,
    "concave": -0.7,
    "right angle": math.pi / 2,
    "tetrahedron": math.acos(-1 / 3),
    "folded": 3.0,
    "nearly shut": math.pi - 1e-3,
    "nearly shut, concave": 1e-3 - math.pi,
}


@pytest.mark.parametrize("name", ANGLES)
def test_bend_is_twice_the_sine_of_half_the_angle(name: str) -> None:
    expected = 1.3 * 2.0 * math.sin(0.5 * ANGLES[name])
    assert float(triangle_pair_bend(folded_pair(ANGLES[name]))) == pytest.approx(expected, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("name", ANGLES)
def test_closed_gradient_equals_autograd(name: str) -> None:
    x = folded_pair(ANGLES[name])
    expected = torch.func.jacrev(triangle_pair_bend)(x).reshape(-1)
    tolerance = 1e-10 if math.pi - abs(ANGLES[name]) > 0.1 else 1e-6  # autograd of 1 + cos a loses digits there
    assert triangle_pair_bend_gradient(x).allclose(expected, rtol=tolerance, atol=tolerance)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_closed_gradient_equals_autograd_in_generic_position(seed: int) -> None:
    x = torch.randn(4, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
    edge, left, right = x[1] - x[0], x[2] - x[0], x[3] - x[0]
    normals = [
        n / torch.linalg.vector_norm(n) for n in (torch.linalg.cross(edge, left), torch.linalg.cross(right, edge))
    ]
    assume(1.0 + float(normals[0] @ normals[1]) > 1e-4)  # not folded: autograd of 1 + cos a loses digits there
    expected = torch.func.jacrev(triangle_pair_bend)(x).reshape(-1)
    scale = float(expected.abs().max())
    assert triangle_pair_bend_gradient(x).allclose(expected, rtol=1e-7, atol=1e-8 * scale)


def test_gradient_of_a_folded_edge_is_that_of_its_length_and_angle() -> None:
    """At a = pi the angle no longer counts (cos a/2 = 0): the bend is 2 l, its gradient twice the unit edge."""
    x = folded_pair(math.pi - 1e-5)
    edge = (x[1] - x[0]) / torch.linalg.vector_norm(x[1] - x[0])
    expected = torch.cat([-2.0 * edge, 2.0 * edge, torch.zeros(6, dtype=DOUBLE)])
    assert triangle_pair_bend_gradient(x).allclose(expected, atol=1e-4)


def test_gradient_is_blind_to_rigid_motion_and_follows_scale() -> None:
    """Translations and rotations change nothing; the bend is a length (Euler's identity of degree one)."""
    x = folded_pair(0.7)
    gradient = triangle_pair_bend_gradient(x).view(4, 3)
    zero = torch.zeros(3, dtype=DOUBLE)
    assert gradient.sum(0).allclose(zero, atol=1e-13)
    assert torch.linalg.cross(x, gradient).sum(0).allclose(zero, atol=1e-13)
    assert float((gradient * x).sum()) == pytest.approx(float(triangle_pair_bend(x)))


@pytest.mark.parametrize("triangles", [True, False])
def test_norm_of_residuals_is_length_times_dual_length(triangles: bool) -> None:
    vertices, topology = wavy_grid(triangles=triangles)
    (term,) = normal_variation_terms(topology, smoothing=1e-2)
    found = torch.linalg.vector_norm(term.values(term.arguments({"vertices": vertices})), dim=1)
    lengths = edge_lengths(vertices, topology)[: topology.num_interior_edges]
    expected = lengths * dual_edge_lengths(vertices, topology)
    assert torch.sort(found).values.allclose(torch.sort(expected).values, atol=1e-12)


def test_sign_is_positive_where_convex() -> None:
    vertices, topology = tetrahedron()
    (term,) = normal_variation_terms(topology, smoothing=1e-2)
    assert bool((term.values(term.arguments({"vertices": vertices})) > 0.0).all())


def test_term_uses_the_closed_gradient() -> None:
    vertices, topology = wavy_grid(triangles=True)
    (term,) = normal_variation_terms(topology, smoothing=1e-2)
    arguments = term.arguments({"vertices": vertices})
    expected = torch.func.vmap(torch.func.jacrev(triangle_pair_bend))(*arguments).flatten(1)
    assert term.jacobian is triangle_pair_bend_gradient
    assert term.linearised(arguments)[1][:, 0].allclose(expected, atol=1e-9)
