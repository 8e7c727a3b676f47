"""Closed curves: interpolation, arc length, corners, places."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from torchfair.curves import ClosedCurve
from torchfair.errors import MeshError, ShapeError
from torchfair.geometry import SplineCurves

TURN = 2.0 * math.pi


def ellipse(t: Tensor) -> Tensor:
    return torch.stack([2.0 * torch.cos(TURN * t), torch.sin(TURN * t), 0.3 * torch.sin(2 * TURN * t)], 1)


def circle(count: int) -> ClosedCurve:
    t = TURN * torch.arange(count, dtype=torch.float64) / count
    return ClosedCurve(torch.stack([t.cos(), t.sin(), 0 * t], 1))


def square(corners: list[int] | None = None) -> ClosedCurve:
    points = [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]]
    return ClosedCurve(torch.tensor([[*p, 0] for p in points], dtype=torch.float64), corners=corners)


def test_points_are_interpolated_at_their_knots() -> None:
    points = ellipse(torch.rand(20, dtype=torch.float64, generator=torch.Generator().manual_seed(1)).sort().values)
    curve = ClosedCurve(points)
    torch.testing.assert_close(curve.at(curve.knots), points, atol=1e-12, rtol=0)
    assert float(curve.knots[0]) == 0.0
    assert bool((curve.knots.diff() > 0).all())


def test_a_circle_is_met_to_fourth_order() -> None:
    errors = []
    for count in (12, 24, 48):
        places = circle(count).at(torch.linspace(0, 1, 777, dtype=torch.float64))
        errors.append(float((places.norm(dim=1) - 1.0).abs().max()))
    assert math.log2(errors[0] / errors[1]) > 3.8
    assert math.log2(errors[1] / errors[2]) > 3.8


def test_the_parameter_is_arc_length() -> None:
    curve = ClosedCurve.from_function(ellipse)
    s = torch.linspace(0, 1, 5001, dtype=torch.float64)
    steps = curve.at(s).diff(dim=0).norm(dim=1)
    torch.testing.assert_close(steps, steps.mean().expand_as(steps), rtol=1e-4, atol=0)
    assert float(steps.sum()) == pytest.approx(curve.length, rel=1e-6)


def test_corners_are_found_kept_and_sharp() -> None:
    curve = square()
    assert curve.length == pytest.approx(8.0)
    torch.testing.assert_close(curve.corners, torch.tensor([0.0, 0.25, 0.5, 0.75], dtype=torch.float64))
    places = curve.at(torch.linspace(0, 1, 81, dtype=torch.float64))
    on_side = torch.minimum((places[:, :2] - 0).abs(), (places[:, :2] - 2).abs()).amin(1)
    assert float(on_side.max()) < 1e-12


def test_spans_are_the_splines_of_a_curve_in_order() -> None:
    """From the first corner on, with corners at both ends; one closed span where there are none."""
    curve = square(corners=[1, 3, 6])
    spans = curve.spans()
    assert [(len(span.points), span.closed) for span in spans] == [(3, False), (4, False), (4, False)]
    points = torch.cat([span.points[:-1] for span in spans])
    torch.testing.assert_close(points, curve.at(curve.knots).roll(-1, 0), rtol=0, atol=1e-14)
    splines = SplineCurves([span.points for span in spans], [False] * 3)
    places = curve.at(torch.linspace(0, 1, 200, dtype=torch.float64))
    distances = torch.stack([splines.closest(places, torch.full((200,), k)).distances for k in range(3)]).amin(0)
    assert float(distances.max()) < 1e-12
    (whole,) = circle(12).spans()
    assert whole.closed
    torch.testing.assert_close(whole.points, circle(12).at(circle(12).knots), rtol=0, atol=1e-14)


def test_places_beside_the_curve_have_the_parameters_of_their_feet() -> None:
    """Also beyond a corner, and nearer to another span than to that of their neighbours."""
    curve = square()
    points = torch.tensor([[1.3, -0.2, 0.5], [-1, -1, 0], [1.2, 1.9, 0], [2.5, 0.4, 0]], dtype=torch.float64)
    expected = torch.tensor([1.3 / 8, 0.0, 4.8 / 8, 2.4 / 8], dtype=torch.float64)
    torch.testing.assert_close(curve.parameters_of(points), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("count", [4, 7, 20, 33])
def test_spaced_parameters_hold_the_corners(count: int) -> None:
    curve = square(corners=[2, 4, 7])
    spaced = curve.spaced(count)
    assert spaced.shape == (count,)
    assert bool((spaced.diff() > 0).all())
    for corner in curve.corners:
        assert float((spaced - corner).abs().min()) < 1e-12
    gaps = torch.cat([spaced.diff(), spaced[:1] + 1.0 - spaced[-1:]])
    assert float(gaps.max()) < 3.0 / count


@given(st.lists(st.floats(0, 0.999), min_size=1, max_size=20), st.booleans())
def test_places_on_the_curve_are_found_again(parameters: list[float], cornered: bool) -> None:
    curve = square(corners=[0, 3]) if cornered else ClosedCurve.from_function(ellipse)
    s = torch.tensor(parameters, dtype=torch.float64)
    again = curve.parameters_of(curve.at(s))
    gap = torch.remainder(again - s + 0.5, 1.0) - 0.5
    assert float(gap.abs().max()) < 1e-9
    assert float((curve.at(again) - curve.at(s)).norm(dim=1).max()) < 1e-9 * curve.length


def test_a_function_with_corners() -> None:
    def lens(t: Tensor) -> Tensor:  # two arcs that meet at an angle
        angle = torch.where(t < 0.5, t, 1.0 - t) * TURN / 2
        side = torch.where(t < 0.5, 1.0, -1.0)
        return torch.stack([torch.cos(2 * angle), side * torch.sin(2 * angle) * 0.5, 0 * t], 1)

    curve = ClosedCurve.from_function(lens, corners=[0.0, 0.5])
    torch.testing.assert_close(curve.corners, torch.tensor([0.0, 0.5], dtype=torch.float64), atol=1e-6, rtol=0)


def test_bad_points_are_refused() -> None:
    with pytest.raises(ShapeError, match="n >= 3"):
        ClosedCurve(torch.zeros(2, 3))
    with pytest.raises(MeshError, match="not finite"):
        ClosedCurve(torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, math.nan, 0]]))
    with pytest.raises(MeshError, match="coincide"):
        ClosedCurve(torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]))
    with pytest.raises(MeshError, match="numbered"):
        square(corners=[9])
    with pytest.raises(MeshError, match="too few"):
        square().spaced(3)
