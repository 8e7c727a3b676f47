"""Splines through points: smooth, accurate, and tame however uneven the points are."""

from __future__ import annotations

import itertools
import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from spline_tools import circle, deviations, everywhere, flower, helix, uneven
from torch import Tensor

from torchfair import MeshError, ShapeError
from torchfair.geometry import SplineCurves

TURN = 2.0 * math.pi
ZERO = torch.zeros(1, dtype=torch.int64)


def frame(points: Tensor, closed: bool, segment: int, fraction: float) -> tuple[Tensor, Tensor]:
    """First and second derivatives by arc length at a place of a segment, from places beside it on that segment."""
    step = 1e-3
    u = fraction + step * torch.arange(5, dtype=DOUBLE) * (1.0 if fraction < 0.5 else -1.0)
    curves = SplineCurves([points], [closed])
    p = curves.at(ZERO.expand(5), torch.full((5,), segment), u)
    h = float(u[1] - u[0])
    # One-sided differences; both are exact for cubics.
    velocity = (-25.0 * p[0] + 48.0 * p[1] - 36.0 * p[2] + 16.0 * p[3] - 3.0 * p[4]) / (12.0 * h)
    acceleration = (2.0 * p[0] - 5.0 * p[1] + 4.0 * p[2] - p[3]) / h**2
    tangent = velocity / velocity.norm()
    return tangent, (acceleration - acceleration.dot(tangent) * tangent) / velocity.dot(velocity)


@pytest.mark.parametrize("closed", [True, False])
def test_tangents_and_curvatures_are_continuous_at_points(closed: bool) -> None:
    """From both sides of every point that is no end, the seam of a closed curve included."""
    points = helix(3.0 * uneven(8, 5.0)) + 0.05 * flower(9)
    count = len(points) if closed else len(points) - 2
    for before in range(count):
        after = (before + 1) % len(points)
        arriving, leaving = frame(points, closed, before, 1.0), frame(points, closed, after, 0.0)
        torch.testing.assert_close(arriving[0], leaving[0], rtol=0, atol=1e-8)
        torch.testing.assert_close(arriving[1], leaving[1], rtol=0, atol=1e-5)


def test_feet_carry_tangents_and_curvatures() -> None:
    points = flower(14)
    curves = SplineCurves([points], [True])
    for segment, fraction in ((0, 0.1), (6, 0.4), (13, 0.9)):
        place = curves.at(ZERO, torch.tensor([segment]), torch.tensor([fraction]))
        feet = curves.closest(place, ZERO)
        tangent, curvature = frame(points, True, segment, fraction)
        assert int(feet.segments) == segment
        assert float(feet.fractions) == pytest.approx(fraction, abs=1e-7)
        torch.testing.assert_close(feet.tangents[0], tangent, rtol=0, atol=1e-6)
        torch.testing.assert_close(feet.curvatures[0], curvature, rtol=0, atol=1e-3)
        assert abs(float(feet.tangents[0] @ feet.curvatures[0])) < 1e-12


def orders(errors: list[float]) -> list[float]:
    return [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]


@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_a_circle_is_met_to_fourth_order(ratio: float) -> None:
    """However uneven its points are; half as far apart where they are twice as many."""
    pattern = uneven(12, ratio)[:-1]
    errors = []
    for doublings in range(4):
        angles = TURN * torch.cat([(pattern + k) / 2**doublings for k in range(2**doublings)])
        errors.append(float((everywhere(circle(angles), True).norm(dim=-1) - 1.0).abs().max()))
    assert min(orders(errors)) > 3.7
    assert errors[-1] < 1e-5


def test_arcs_of_circles_are_met_to_fourth_order() -> None:
    errors = []
    for count in (8, 16, 32):
        places = everywhere(circle(torch.linspace(0.0, 2.0, count + 1, dtype=DOUBLE)), False)
        errors.append(float((places.norm(dim=-1) - 1.0).abs().max()))
    assert min(orders(errors)) > 3.8


def test_a_helix_is_met_to_fourth_order_inside_and_third_order_at_its_ends() -> None:
    inside, at_ends = [], []
    for count in (8, 16, 32, 64):
        places = everywhere(helix(torch.linspace(0.0, math.pi, count + 1, dtype=DOUBLE)), False)
        angle = torch.atan2(places[..., 1], places[..., 0]).remainder(TURN)
        angle = torch.where(angle > 1.5 * math.pi, angle - TURN, angle)
        radial = (places[..., :2].norm(dim=-1) - 1.0).abs()
        error = torch.maximum(radial, (angle - places[..., 2]).abs()).amax(1)
        inside.append(float(error[count // 3 : -(count // 3)].max()))
        at_ends.append(float(error.max()))
    assert min(orders(inside)[1:]) > 3.8
    assert min(orders(at_ends)) > 2.9


def test_straight_lines_and_parabolas() -> None:
    """Two points make a straight line with even speed; three a parabola, here with the axis y."""
    ends = torch.tensor([[0.0, 1, 2], [3, 5, 2]], dtype=DOUBLE)
    line = everywhere(ends, False)[0]
    torch.testing.assert_close(line, ends[0].lerp(ends[1], torch.linspace(0, 1, len(line), dtype=DOUBLE)[:, None]))
    places = everywhere(torch.tensor([[-1.0, 1, 0], [0, 0, 0], [1, 1, 0]], dtype=DOUBLE), False)
    torch.testing.assert_close(places[..., 1], places[..., 0] ** 2, rtol=0, atol=1e-14)


def chamfered_square(chamfer: float) -> Tensor:
    """Unit sides joined by three turns of 30 degrees, two short edges at every corner."""
    turns = torch.arange(12, dtype=DOUBLE) * (math.pi / 6)
    lengths = torch.tensor([1.0, chamfer, chamfer], dtype=DOUBLE).repeat(4)
    return torch.stack([lengths * turns.cos(), lengths * turns.sin(), 0 * turns], 1).cumsum(0)


@pytest.mark.parametrize("chamfer", [1.0, 0.1, 1e-2, 1e-4])
def test_a_square_with_chamfers_keeps_near_its_sides(chamfer: float) -> None:
    """A regular polygon that turns as much bulges by 7 percent of its sides."""
    assert float(deviations(chamfered_square(chamfer), True).max()) < 0.11


@pytest.mark.parametrize("ratio", [3.0, 20.0, 1000.0])
@pytest.mark.parametrize("least", [-40.0, 0.0])
def test_no_segment_leaves_its_chord_by_more_than_a_fifth(ratio: float, least: float) -> None:
    """Random turns of at most 40 degrees between edges of very different length, back and forth or to one side."""
    worst = 0.0
    for seed in range(80):
        generator = torch.Generator().manual_seed(seed)
        turns = least + (40.0 - least) * torch.rand(9, dtype=DOUBLE, generator=generator)
        heading = torch.deg2rad(turns.cumsum(0))
        edges = uneven(9, ratio, seed).diff()[:, None] * circle(heading)
        worst = max(worst, float(deviations(edges.cumsum(0), False).max()))
    assert worst < 0.2


def test_uneven_points_of_a_circle_stay_near_it() -> None:
    """Compared with the bulge of the circle over the longest chord."""
    for seed in range(30):
        angles = TURN * uneven(24, 30.0, seed)
        error = float((everywhere(circle(angles[:-1]), True).norm(dim=-1) - 1.0).abs().max())
        assert error < 0.1 * (1.0 - math.cos(0.5 * float(angles.diff().max())))


def test_splines_turn_shift_and_scale_with_their_points_and_do_not_depend_on_their_direction() -> None:
    points = helix(4.0 * uneven(9, 6.0))
    places, turn = everywhere(points, False), random_rotation(2)
    moved = everywhere(1e3 * points @ turn.T + 50.0, False)
    torch.testing.assert_close(moved, 1e3 * places @ turn.T + 50.0, rtol=1e-12, atol=1e-9)
    torch.testing.assert_close(everywhere(points.flip(0), False).flip(0, 1), places, rtol=0, atol=1e-13)
    closed = everywhere(points, True)
    torch.testing.assert_close(everywhere(points.roll(4, 0), True).roll(-4, 0), closed, rtol=0, atol=1e-13)


def test_bad_curves_are_refused() -> None:
    points = flower(5)
    with pytest.raises(ShapeError, match="one bool for each of 2 curves"):
        SplineCurves([points, points], [True])
    with pytest.raises(MeshError, match="no curve was given"):
        SplineCurves([], [])
    with pytest.raises(ShapeError, match="curve 1"):
        SplineCurves([points, points[:, :2]], [True, True])
    with pytest.raises(MeshError, match=r"curve 1 is closed and has 2 point\(s\). Give at least 3"):
        SplineCurves([points, points[:2]], [True, True])
    with pytest.raises(MeshError, match=r"curve 0 is open and has 1 point\(s\). Give at least 2"):
        SplineCurves([points[:1]], [False])
    with pytest.raises(MeshError, match="not finite"):
        SplineCurves([points / 0], [True])
    twice = torch.cat([points[:2], points[1:], points[:1]])
    with pytest.raises(MeshError, match=r"curve 0: points coincide with the next ones: 1, 6\. Leave them out"):
        SplineCurves([twice], [True])
    with pytest.raises(MeshError, match=r"coincide with the next ones: 1\. Leave them out"):
        SplineCurves([twice], [False])
