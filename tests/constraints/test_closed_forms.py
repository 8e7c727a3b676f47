"""Closed forms of ready-made terms: against automatic differentiation, against plain formulas, and where those fail."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE
from term_cases import CASES, mixed, moved, triangles
from torch import Tensor

from torchfair import constraints as c
from torchfair.constraints import barrier
from torchfair.constraints._components import area_derivatives, area_vectors, components_first, cross, dot, lengths
from torchfair.constraints._polygon_bend import polygon_bend, polygon_pair_bend
from torchfair.constraints.barrier import barrier_slope
from torchfair.constraints.closeness import TangentPlanes
from torchfair.constraints.normal_variation import edge_stencils, triangle_pair_bend
from torchfair.constraints.planarity import diagonal_distance
from torchfair.geometry import ReferenceSurface, corner_angles, face_areas
from torchfair.projection import ElementTerm
from torchfair.projection.layout import State

CPU = torch.device("cpu")


def assert_closed_form_is_the_derivative(term: ElementTerm, state: State) -> Tensor:
    arguments = term.arguments(state)
    closed = replace(term, derivatives="closed form").jacobians(arguments)
    values, expected = replace(term, derivatives=None).automatic_derivatives(arguments)
    assert closed.shape == expected.shape
    torch.testing.assert_close(closed, expected, rtol=1e-8, atol=1e-9 * float(expected.abs().max()))
    return values


@pytest.mark.parametrize("name", CASES)
def test_closed_forms_are_derivatives_in_generic_position(name: str) -> None:
    for state, terms in CASES[name](CPU):
        for term in terms:
            if term.jacobian is not None:
                term.arguments({key: 0.99 * block for key, block in state.items()})  # some remember the state before
                assert_closed_form_is_the_derivative(term, state)


@pytest.mark.parametrize("shape", [triangles, mixed])
def test_barriers_have_closed_forms_where_they_are_felt_silent_and_broken(shape: object) -> None:
    """Bounds between the smallest and the largest angle and area, so that all three kinds occur."""
    vertices, topology = shape(CPU)  # type: ignore[operator]
    angles = corner_angles(vertices, topology)
    bound, silent = float(angles.quantile(0.2)), torch.full_like(angles, float(angles.quantile(0.6)))
    terms = c.corner_angle_terms(topology, bound, silent, weight=1.0)
    areas = face_areas(vertices, topology) * torch.linspace(0.9, 4.0, topology.num_faces, dtype=DOUBLE)
    terms += c.face_area_terms(topology, areas, smallest=0.3, safe=0.8, weight=1.0)
    planes = TangentPlanes(ReferenceSurface(vertices, topology))
    limits = torch.linspace(1e-3, 0.3, topology.num_vertices, dtype=DOUBLE)
    terms += c.distance_limit_terms(planes, limits, weight=1.0)
    found: dict[str, list[Tensor]] = {}
    for term in terms:
        state = {"vertices": moved(vertices) if term.name == "distance limit" else vertices}
        found.setdefault(term.name, []).append(assert_closed_form_is_the_derivative(term, state))
    for name, parts in found.items():
        values = torch.cat(parts)
        assert bool((values == 0.0).any()), name
        assert bool(torch.isinf(values).any()), name
        assert bool(((values > 0.0) & torch.isfinite(values)).any()), name


def test_slope_of_the_barrier() -> None:
    margin = torch.tensor([-1.0, 0.0, 1e-3, 0.25, 0.499, 0.5, 2.0], dtype=DOUBLE, requires_grad=True)
    safe = torch.tensor(0.5, dtype=DOUBLE)
    value = barrier(margin, safe)
    (expected,) = torch.autograd.grad(value[torch.isfinite(value)].sum(), margin)
    torch.testing.assert_close(barrier_slope(margin.detach(), safe), expected)
    assert float(expected[1]) == pytest.approx(-0.55 / 0.05**2)


def test_corners_without_an_angle_and_faces_without_area_pull_nowhere() -> None:
    """Straight and closed corners have kinks; a solver that lands there must not get NaN."""
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=DOUBLE)
    topology = triangles(CPU)[1].from_faces([[0, 1, 2]])
    angles = c.corner_angle_terms(topology, 0.0, torch.full((3,), 4.0, dtype=DOUBLE), weight=1.0)
    areas = c.face_area_terms(topology, torch.ones(1, dtype=DOUBLE), smallest=0.0, weight=1.0)
    for term in (*angles, *areas):
        arguments = term.arguments({"vertices": vertices})
        assert bool(torch.isfinite(term.values(arguments)).all())
        assert not term.jacobians(arguments).any()
        assert not term.automatic_derivatives(arguments)[1].any()


# ---- plain formulas, element by element -------------------------------------------------------------------


def area_vector(polygon: Tensor) -> Tensor:
    return 0.5 * sum(torch.linalg.cross(a, b) for a, b in zip(polygon, polygon.roll(-1, 0), strict=True))


def test_bend_of_polygons_is_length_times_the_jump_of_normals_across_and_along() -> None:
    vertices, topology = mixed(CPU)
    for (left_size, _), stencil in edge_stencils(topology).items():
        found = polygon_pair_bend(vertices[stencil], left_size)
        for x, (across, along) in zip(vertices[stencil], found.tolist(), strict=True):
            left, right = area_vector(x[:left_size]), area_vector(torch.stack([x[1], x[0], *x[left_size:]]))
            jump = right / right.norm() - left / left.norm()
            mean, edge = (right / right.norm() + left / left.norm()), x[1] - x[0]
            mean = mean / mean.norm()
            flat = edge - (edge @ mean) * mean
            flat = flat / flat.norm()
            assert along == pytest.approx(float(edge.norm() * jump @ flat), abs=1e-13)
            assert across == pytest.approx(float(edge.norm() * jump @ torch.linalg.cross(flat, mean)), abs=1e-13)
            assert math.hypot(across, along) == pytest.approx(float(edge.norm() * jump.norm()), abs=1e-13)


@pytest.mark.parametrize("function", [triangle_pair_bend, diagonal_distance, lambda x: polygon_pair_bend(x, 3)])
def test_one_element_has_the_residual_that_it_has_among_many(function: object) -> None:
    x = torch.randn(7, 4, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    together = function(x)  # type: ignore[operator]
    for one, expected in zip(x, together, strict=True):
        torch.testing.assert_close(function(one), expected)  # type: ignore[operator]


def test_one_element_has_the_derivative_that_it_has_among_many() -> None:
    x = torch.randn(7, 6, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    bend = polygon_bend(4)
    assert polygon_bend(4) is bend
    for one, expected in zip(x, bend.jacobian(x), strict=True):
        torch.testing.assert_close(bend.jacobian(one), expected)


@pytest.mark.parametrize("size", [3, 4, 5, 6])
def test_area_vectors_and_their_derivatives(size: int) -> None:
    generator = torch.Generator().manual_seed(size)
    x = torch.randn(5, size, 3, dtype=DOUBLE, generator=generator) + 10.0
    direction = torch.randn(3, 5, dtype=DOUBLE, generator=generator)
    corners = components_first(x)
    expected = torch.stack([area_vector(polygon - polygon[0]) for polygon in x], dim=1)
    torch.testing.assert_close(area_vectors(corners), expected)
    corners.requires_grad_()
    (slope,) = torch.autograd.grad(dot(direction, area_vectors(corners)).sum(), corners)
    torch.testing.assert_close(area_derivatives(corners.detach(), direction), slope)


def test_products_along_the_first_dimension() -> None:
    a, b = torch.randn(2, 3, 4, 5, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(cross(a, b), torch.linalg.cross(a, b, dim=0))
    torch.testing.assert_close(dot(a, b), (a * b).sum(0))
    a[:, 0, 0], a[:, 1, 1] = 0.0, torch.nan
    torch.testing.assert_close(lengths(a), torch.linalg.vector_norm(a, dim=0), equal_nan=True)
    zero = torch.zeros(3, 2, dtype=DOUBLE, requires_grad=True)
    (slope,) = torch.autograd.grad(lengths(zero).sum(), zero)
    assert not slope.any()
