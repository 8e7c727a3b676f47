"""Gliding on curves: the merit is the squared distance, the model fits it, and ends let nothing beyond."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE
from spline_tools import flower, helix
from torch import Tensor

from torchfair import constraints
from torchfair.geometry import SplineCurves
from torchfair.projection import ElementTerm, ProjectionSettings, guided_projection

WEIGHT = 3.0
RING, ARC = flower(12), 2.0 * helix(torch.arange(6, dtype=DOUBLE) / 2.0) + 5.0


def feet_of(count: int) -> constraints.CurveFeet:
    """Vertices 1, 2, ... of a state glide, on a closed and on an open curve by turns; vertex 0 does not."""
    curves = SplineCurves([RING, ARC], [True, False])
    return constraints.CurveFeet(curves, torch.arange(1, count + 1), torch.arange(count) % 2)


def gliding(count: int) -> ElementTerm:
    (term,) = constraints.gliding_terms(feet_of(count), weight=WEIGHT)
    return term


def scattered(size: float, count: int = 40, seed: int = 0) -> Tensor:
    """Vertices beside their curves, curved places and the ends of the open curve among them."""
    generator = torch.Generator().manual_seed(seed)
    on_ring, on_arc = (curve[torch.randint(len(curve), (count // 2,), generator=generator)] for curve in (RING, ARC))
    places = torch.stack([on_ring, on_arc], 1).reshape(-1, 3)
    places = places + size * torch.randn(places.shape, dtype=DOUBLE, generator=generator)
    return torch.cat([places.new_full((1, 3), 9.0), places])


def merit(term: ElementTerm, vertices: Tensor) -> Tensor:
    arguments = term.arguments({"vertices": vertices})
    return term.contributions(arguments, term.values(arguments))


def test_the_merit_is_half_the_weight_times_the_squared_distance() -> None:
    vertices, feet = scattered(0.2), feet_of(40)
    distances = feet({"vertices": vertices}).distances
    assert feet({"vertices": vertices}).beyond_end.any()
    torch.testing.assert_close(merit(gliding(40), vertices), 0.5 * WEIGHT * distances**2, rtol=1e-12, atol=0)
    on_curve = torch.cat([vertices[:1], torch.stack([RING, ARC.repeat(2, 1)], 1).reshape(-1, 3)])
    assert float(merit(gliding(24), on_curve).max()) == 0.0


@pytest.mark.parametrize("size", [0.02, 0.2])
def test_model_and_merit_agree_to_first_order(size: float) -> None:
    """Along random directions, at curved places, beside and beyond ends, by central differences."""
    vertices, term, step = scattered(size), gliding(40), 1e-5
    values, jacobians = term.linearised(term.arguments({"vertices": vertices}))
    for seed in range(4):
        way = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
        ahead, behind = (merit(term, vertices + sign * step * way) for sign in (1.0, -1.0))
        slope = WEIGHT * torch.einsum("nm,nmk,nk->n", values, jacobians, way[1:])
        torch.testing.assert_close((ahead - behind) / (2.0 * step), slope, rtol=0, atol=1e-6)


def test_on_the_curve_the_model_agrees_to_second_order() -> None:
    vertices, term = scattered(0.0), gliding(40)
    feet = feet_of(40)({"vertices": vertices})
    inside = ~(vertices[1:, None] == ARC[[0, -1]]).all(-1).any(1)
    values, jacobians = term.linearised(term.arguments({"vertices": vertices}))
    assert float(values.abs().max()) == 0.0
    way = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    model = 0.5 * WEIGHT * torch.einsum("nmk,nk->nm", jacobians, way[1:]).square().sum(1)
    errors = []
    for step in (1e-2, 1e-3):
        found = merit(term, vertices + step * way) / step**2
        errors.append(float((found - model)[inside].abs().max()))
    assert errors[1] < 0.12 * errors[0]
    assert float((feet.tangents[:, None] @ jacobians).abs().max()) < 1e-14


def test_the_closed_form_of_the_derivative() -> None:
    term = gliding(40)
    arguments = term.arguments({"vertices": scattered(0.3)})
    by_hand = term.jacobians(arguments)
    plain = ElementTerm(term.name, term.residual, term.stencil, batched=True)
    torch.testing.assert_close(by_hand, plain.linearised(arguments)[1], rtol=0, atol=1e-15)


def test_beyond_an_end_nothing_is_free() -> None:
    tangent = ARC[0] - ARC[1]
    outside, beside = ARC[0] + tangent, ARC[2] + torch.tensor([0.0, 0.0, 0.1], dtype=DOUBLE)
    vertices = torch.stack([outside, outside, outside, beside, beside])
    term = gliding(4)  # 2 and 4 on the arc
    _, jacobians = term.linearised(term.arguments({"vertices": vertices}))
    assert torch.equal(jacobians[1], torch.eye(3, dtype=DOUBLE))
    assert torch.linalg.matrix_rank(jacobians[3]) == 2


def test_vertices_are_drawn_onto_their_curves_and_slide_along_them() -> None:
    """The place on a circle nearest to a target off it is found, however the curve bends on the way."""
    angles = 2.0 * math.pi * torch.arange(40, dtype=DOUBLE) / 40
    ring = torch.stack([angles.cos(), angles.sin(), 0 * angles], 1)
    feet = constraints.CurveFeet(SplineCurves([ring], [True]), torch.tensor([0]), torch.tensor([0]))
    target = torch.tensor([[-1.0, 2.0, 0.5]], dtype=DOUBLE)
    terms = [
        *constraints.gliding_terms(feet, weight=1e4),
        *constraints.handle_terms(torch.tensor([0]), target, weight=1.0),
    ]
    result = guided_projection(
        {"vertices": ring[:1]}, terms, settings=ProjectionSettings(max_iterations=300, merit_tolerance=1e-12)
    )
    expected = target * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE) / math.sqrt(5.0)
    torch.testing.assert_close(result.blocks["vertices"], expected, rtol=0, atol=1e-3)


def test_feet_are_sought_anew_when_a_state_is_changed_in_place() -> None:
    feet, vertices = feet_of(2), scattered(0.1, 2)
    state = {"vertices": vertices}
    before = feet(state)
    assert feet(state) is before
    vertices += 0.05
    assert not torch.equal(feet(state).distances, before.distances)
    with torch.inference_mode():
        frozen = vertices + 0.0
        first = feet({"vertices": frozen}).distances.clone()
        frozen += 0.05
        assert not torch.equal(feet({"vertices": frozen}).distances, first)


def test_no_vertices_no_term() -> None:
    assert constraints.gliding_terms(feet_of(0), weight=1.0) == []


def test_the_last_three_states_are_not_searched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    feet, asked = feet_of(4), []
    search = SplineCurves.closest

    def closest(self: SplineCurves, points: Tensor, curves: Tensor) -> object:
        asked.append(points)
        return search(self, points, curves)

    monkeypatch.setattr(SplineCurves, "closest", closest)
    a, b, c, d = ({"vertices": scattered(0.1, 4, seed)} for seed in range(4))
    for state, searches in ((a, 1), (a, 1), (b, 2), (c, 3), (a, 3), (d, 4), (a, 4), (c, 4), (b, 5), (a, 5)):
        found = feet(state)
        assert len(asked) == searches
        torch.testing.assert_close(found.positions, feet_of(4)(state).positions, rtol=0, atol=0)
        del asked[searches:]
    a["vertices"] += 0.01  # in place
    moved = feet(a).positions
    assert len(asked) == 6
    torch.testing.assert_close(moved, feet_of(4)({"vertices": a["vertices"].clone()}).positions, rtol=0, atol=0)
    tracked = {"vertices": a["vertices"].clone().requires_grad_()}
    feet(tracked)
    feet(tracked)
    assert all(not points.requires_grad for points, *_ in feet._kept)
    assert len(feet._kept) == 3
