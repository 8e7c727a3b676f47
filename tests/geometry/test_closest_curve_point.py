"""Closest points on polylines: closed forms, a slow reference, and every point sees only its own curve."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from helpers import DOUBLE, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from torchfair import MeshError, ShapeError
from torchfair.geometry.closest_curve_point import ReferenceCurve, ReferenceCurves


def slow_distance(point: Tensor, curve: Tensor, closed: bool) -> float:
    """Smallest distance of a point to the segments, one after the other."""
    following = curve.roll(-1, 0)
    pairs = list(zip(curve, following, strict=True))[: None if closed else -1]
    distances = []
    for start, end in pairs:
        edge = end - start
        length = edge.dot(edge).item()
        t = min(max((point - start).dot(edge).item() / length, 0.0), 1.0) if length else 0.0
        distances.append((point - start - t * edge).norm().item())
    return min(distances)


def tensor(rows: object) -> Tensor:
    return torch.tensor(rows, dtype=DOUBLE).reshape(-1, 3)


STEPS = tensor([[0.0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]])


@pytest.mark.parametrize(
    ("point", "position", "segment", "fraction", "tangent"),
    [
        ([1, -2, 0], [1, 0, 0], 0, 0.25, [1, 0, 0]),
        ([5, 1, 7], [4, 1, 0], 1, 1 / 3, [0, 1, 0]),
        ([3, 9, 0], [3, 3, 0], 2, 0.25, [-1, 0, 0]),
        ([-3, -4, 0], [0, 0, 0], 0, 0, [1, 0, 0]),  # before the start
        ([-3, 4, 0], [0, 3, 0], 2, 1, [-1, 0, 0]),  # beyond the end
        ([5, -1, 0], [4, 0, 0], 0, 1, [1, 0, 0]),  # at a corner: the segment of the lowest number
    ],
)
def test_closest_points_on_three_sides_of_a_rectangle(point, position, segment, fraction, tangent):
    found = ReferenceCurve(STEPS, closed=False).closest(tensor([point]))
    assert found.positions[0].tolist() == position
    assert found.distances.item() == math.dist(point, position)
    assert found.segments.item() == segment
    assert found.fractions.item() == pytest.approx(fraction, rel=1e-15)
    assert found.tangents[0].tolist() == tangent


def test_a_closed_curve_has_one_more_segment():
    point = tensor([[-1.0, 1, 0]])
    found = ReferenceCurve(STEPS, closed=True).closest(point)
    assert (found.distances.item(), found.segments.item()) == (1, 3)
    assert found.tangents[0].tolist() == [0, -1, 0]
    assert ReferenceCurve(STEPS, closed=False).closest(point).distances.item() == math.sqrt(2)


coordinate = st.one_of(st.integers(-3, 3).map(float), st.floats(-3, 3, width=32))
triple = st.tuples(coordinate, coordinate, coordinate)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.lists(triple, min_size=2, max_size=9), st.booleans()), min_size=1, max_size=6),
    st.lists(st.tuples(triple, st.integers(0, 5)), max_size=6),
)
def test_every_point_is_measured_to_its_own_curve(curves, queries):
    points = tensor([point for point, _ in queries])
    owners = torch.tensor([owner % len(curves) for _, owner in queries], dtype=torch.int64)
    shapes, closed = [tensor(points) for points, _ in curves], [is_closed for _, is_closed in curves]
    found = ReferenceCurves(shapes, closed).closest(points, owners)
    for row, owner in enumerate(owners.tolist()):
        slow = slow_distance(points[row], shapes[owner], closed[owner])
        assert found.distances[row].item() == pytest.approx(slow, rel=1e-14, abs=1e-14)
        alone = ReferenceCurve(shapes[owner], closed[owner]).closest(points[row : row + 1])
        for together, single in zip(found, alone, strict=True):
            assert torch.equal(together[row], single[0])


def test_many_curves_at_once_are_the_curves_one_by_one():
    """Long curves that cross each other, points anywhere."""
    generator = np.random.default_rng(0)
    curves = [torch.from_numpy(generator.normal(size=(n, 3)).cumsum(0)) for n in (300, 2, 40, 7, 120)]
    closed = [True, False, False, True, False]
    points = torch.from_numpy(5 * generator.normal(size=(400, 3)))
    owners = torch.from_numpy(generator.integers(0, 5, 400))
    found = ReferenceCurves(curves, closed).closest(points, owners)
    for number, (curve, is_closed) in enumerate(zip(curves, closed, strict=True)):
        rows = owners == number
        alone = ReferenceCurve(curve, is_closed).closest(points[rows])
        assert all(torch.equal(x[rows], y) for x, y in zip(found, alone, strict=True))
    assert found.distances[0].item() == pytest.approx(
        slow_distance(points[0], curves[owners[0]], closed[owners[0]]), rel=1e-14
    )
    assert (found.tangents.norm(dim=1) - 1).abs().max() < 1e-15 * 8


@pytest.mark.parametrize("size", [2, 3, 30])
@pytest.mark.parametrize("closed", [True, False])
def test_points_of_the_curve_have_distance_zero(closed, size):
    """To the last bit, the ends of open curves included."""
    curves = torch.randn(100, size, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    owners = torch.arange(100).repeat_interleave(size)
    found = ReferenceCurves(list(curves), [closed] * 100).closest(curves.reshape(-1, 3), owners)
    assert torch.equal(found.distances, torch.zeros(100 * size, dtype=DOUBLE))
    assert torch.equal(found.positions, curves.reshape(-1, 3))


def test_rigid_motions_and_scaling():
    points = torch.randn(60, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0)) * 4
    found = ReferenceCurve(STEPS, closed=True).closest(points)
    turn, shift = random_rotation(1), tensor([[5.0, 6, -7]])
    moved = ReferenceCurve(STEPS @ turn.T + shift, closed=True).closest(points @ turn.T + shift)
    torch.testing.assert_close(moved.distances, found.distances, rtol=1e-13, atol=1e-13)
    torch.testing.assert_close(moved.positions, found.positions @ turn.T + shift, rtol=1e-13, atol=1e-13)
    for power in (-120, 80):
        scaled = ReferenceCurve(STEPS * 2.0**power, closed=True).closest(points * 2.0**power)
        assert torch.equal(scaled.distances, found.distances * 2.0**power)
        assert torch.equal(scaled.segments, found.segments)


def test_far_from_the_origin_no_digit_is_lost():
    """Coordinates of 25 binary digits are exact before and after the shift, and so are all differences."""
    generator = torch.Generator().manual_seed(0)
    points, curve = (torch.randint(2**25, (n, 3), generator=generator).double() * 2.0**-30 for n in (300, 40))
    near = ReferenceCurve(curve, closed=True).closest(points)
    far = ReferenceCurve(curve + 2.0**20, closed=True).closest(points + 2.0**20)
    assert torch.equal(near.distances, far.distances)
    assert torch.equal(near.segments, far.segments)


def test_a_polygon_inscribed_in_a_circle():
    """The circle is at most 1 - cos(pi / n) away, above the middles of the sides."""
    count = 30
    angles = torch.arange(2 * count, dtype=DOUBLE) * (math.pi / count)
    circle = torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], dim=1)
    found = ReferenceCurve(circle[::2], closed=True).closest(circle)
    sagitta = torch.full((count,), 1 - math.cos(math.pi / count), dtype=DOUBLE)
    torch.testing.assert_close(found.distances[1::2], sagitta, rtol=1e-12, atol=0)
    assert torch.equal(found.segments[1::2], torch.arange(count))


def test_segments_without_length_are_passed_over():
    curve = tensor([[0.0, 0, 0], [0, 0, 0], [2, 0, 0], [2, 0, 0], [2, 0, 0], [2, 5, 0]])
    found = ReferenceCurve(curve, closed=False).closest(tensor([[-1.0, 0, 0], [2, 0, 1], [3, 1, 0]]))
    assert found.segments.tolist() == [1, 1, 4]
    assert found.tangents.tolist() == [[1, 0, 0], [1, 0, 0], [0, 1, 0]]
    point = ReferenceCurve(torch.ones(3, 3, dtype=DOUBLE), closed=True).closest(tensor([[1.0, 1, 4]]))
    assert point.distances.item() == 3
    assert point.tangents[0].tolist() == [0, 0, 0]


def test_no_points_and_single_precision():
    curves = ReferenceCurves([STEPS.float()], [True])
    none = curves.closest(torch.zeros(0, 3), torch.zeros(0, dtype=torch.int64))
    assert none.positions.shape == none.tangents.shape == (0, 3)
    points = torch.tensor([[1.0, -2, 0]], requires_grad=True)
    found = curves.closest(points, torch.zeros(1, dtype=torch.int32))
    assert {x.dtype for x in found} == {torch.float32, torch.int64}
    assert not any(x.requires_grad for x in found)


def test_input_that_cannot_be_measured_is_refused():
    curves = ReferenceCurves([STEPS, STEPS], [True, False])
    point, first = torch.zeros(1, 3), torch.zeros(1, dtype=torch.int64)
    with pytest.raises(MeshError, match=r"points: 1 point\(s\) are not finite.*row 0"):
        curves.closest(point / 0, first)
    with pytest.raises(MeshError, match=r"out of range 0..1: point 0 asks for curve 2\. Count"):
        curves.closest(point, first + 2)
    with pytest.raises(MeshError, match="curve -1"):
        curves.closest(point, first - 1)
    for wrong in (first[:0], first.float(), first.bool(), [0]):
        with pytest.raises(ShapeError, match="curves"):
            curves.closest(point, wrong)
    with pytest.raises(ShapeError, match="curve 1"):
        ReferenceCurves([STEPS, STEPS[:, :2]], [True, True])
    with pytest.raises(ShapeError, match="closed"):
        ReferenceCurves([STEPS], [True, False])
    with pytest.raises(MeshError, match=r"curve 0 has 1 point\(s\)"):
        ReferenceCurve(STEPS[:1], closed=True)
    with pytest.raises(MeshError, match=r"curve 0: 4 point\(s\) are not finite"):
        ReferenceCurve(STEPS / 0, closed=True)
    with pytest.raises(MeshError, match="no curve"):
        ReferenceCurves([], [])
