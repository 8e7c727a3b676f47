"""Closest points on splines: exact feet, against dense samples and closed forms, on any kind of tensor."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from spline_tools import circle, flower, helix, sampled_distances, spiral, uneven
from torch import Tensor
from torch._subclasses.fake_tensor import FakeTensorMode

from torchfair import ShapeError
from torchfair.geometry import ReferenceCurve, SplineCurves, SplineFeet

TURN = 2.0 * math.pi


def zeros(count: int) -> Tensor:
    return torch.zeros(count, dtype=torch.int64)


def noise(points: Tensor, size: float, seed: int = 0) -> Tensor:
    return size * torch.randn(points.shape, dtype=points.dtype, generator=torch.Generator().manual_seed(seed))


CURVES = {
    "flower": (flower(60), True),
    "coarse flower": (flower(14, petals=2, depth=0.5), True),
    "long flower": (flower(1500, petals=30, depth=0.6), True),
    "spiral": (spiral(500), False),
    "helix": (helix(12.0 * uneven(40, 10.0)), False),
    "three points": (flower(7)[:3], False),
    "triangle": (flower(3), True),
    "line": (flower(7)[:2], False),
    "loop with one corner": (torch.cat([flower(20), flower(20)[:1]]), False),
}


def found_near(name: str, size: float) -> tuple[Tensor, SplineFeet]:
    """Some 200 points beside the curve, by multiples of its mean edge, and their feet."""
    points, closed = CURVES[name]
    edge = float(points.diff(dim=0).norm(dim=1).mean())
    queries = points.repeat(-(-200 // len(points)), 1)
    queries = queries[:: len(queries) // 200]
    queries = queries + noise(queries, size * edge)
    return queries, SplineCurves([points], [closed]).closest(queries, zeros(len(queries)))


@pytest.mark.parametrize("size", [0.03, 0.3, 1.0])
@pytest.mark.parametrize("name", CURVES)
def test_no_sample_of_the_curve_is_nearer_than_the_foot(name: str, size: float) -> None:
    queries, feet = found_near(name, size)
    assert float((feet.distances - sampled_distances(queries, *CURVES[name])).max()) < 1e-13
    torch.testing.assert_close((queries - feet.positions).norm(dim=1), feet.distances, rtol=0, atol=0)


@pytest.mark.parametrize("name", CURVES)
def test_offsets_are_orthogonal_to_the_curve_but_beyond_its_ends(name: str) -> None:
    queries, feet = found_near(name, 0.5)
    slide = ((queries - feet.positions) * feet.tangents).sum(1)
    assert float(slide[~feet.beyond_end].abs().max()) < 1e-13
    points, closed = CURVES[name]
    ends = points[[0, -1]]
    at_end = (feet.positions[:, None] == ends).all(-1)
    assert not bool((feet.beyond_end & ~at_end.any(1)).any())
    assert bool(feet.beyond_end.any()) != closed
    outwards = torch.where(at_end[:, 0], -slide, slide)
    if name != "loop with one corner":  # where both ends are at one place
        assert bool((outwards[feet.beyond_end] > 0.0).all())


@pytest.mark.parametrize("name", CURVES)
def test_given_points_lie_on_the_curve_to_the_last_bit(name: str) -> None:
    points, closed = CURVES[name]
    for dtype in (torch.float64, torch.float32):
        given = points.to(dtype)
        feet = SplineCurves([given], [closed]).closest(given, zeros(len(given)))
        assert torch.equal(feet.distances, torch.zeros_like(feet.distances))
        assert torch.equal(feet.positions, given)
        assert not bool(feet.beyond_end.any())


def test_positions_are_those_at_segment_and_fraction() -> None:
    curves = SplineCurves([flower(9), helix(torch.arange(5, dtype=DOUBLE))], [True, False])
    owners = torch.arange(80) % 2
    feet = curves.closest(noise(torch.zeros(80, 3, dtype=DOUBLE), 1.0), owners)
    torch.testing.assert_close(curves.at(owners, feet.segments, feet.fractions), feet.positions, rtol=0, atol=0)
    assert int(feet.segments[owners == 0].max()) == 8
    assert int(feet.segments[owners == 1].max()) == 3


def test_a_fine_circle_gives_the_feet_of_the_circle() -> None:
    curves = SplineCurves([circle(TURN * torch.arange(400, dtype=DOUBLE) / 400)], [True])
    angles = torch.linspace(0.0, 6.0, 50, dtype=DOUBLE)
    for radius, height in ((0.5, 0.0), (1.0, 0.2), (3.0, -1.0)):
        points = circle(angles, radius) + torch.tensor([0.0, 0.0, height], dtype=DOUBLE)
        feet = curves.closest(points, zeros(50))
        torch.testing.assert_close(feet.positions, circle(angles), rtol=0, atol=1e-7)
        assert feet.distances.allclose(torch.tensor(math.hypot(radius - 1.0, height), dtype=DOUBLE), atol=1e-8)
        torch.testing.assert_close(feet.tangents, circle(angles + math.pi / 2), rtol=0, atol=1e-5)
        torch.testing.assert_close(feet.curvatures, -circle(angles), rtol=0, atol=1e-4)


def test_two_points_are_the_segment_between_them() -> None:
    ends = torch.tensor([[0.0, 1, 2], [3, 5, 2]], dtype=DOUBLE)
    points = noise(torch.zeros(100, 3, dtype=DOUBLE), 4.0)
    feet = SplineCurves([ends], [False]).closest(points, zeros(100))
    straight = ReferenceCurve(ends, closed=False).closest(points)
    for name in ("positions", "distances", "fractions", "tangents"):
        torch.testing.assert_close(getattr(feet, name), getattr(straight, name), rtol=0, atol=1e-13)
    assert torch.equal(feet.beyond_end, (straight.fractions == 0.0) | (straight.fractions == 1.0))
    assert float(feet.curvatures.abs().max()) < 1e-13


def test_every_point_sees_its_own_curve_and_nothing_of_the_other_points() -> None:
    shapes, closed = [points for points, _ in CURVES.values()], [ring for _, ring in CURVES.values()]
    curves = SplineCurves(shapes, closed)
    owners = torch.arange(9).repeat_interleave(12)
    points = torch.cat([shape[torch.arange(12) % len(shape)] for shape in shapes])
    points = points + noise(points, 0.05)
    together = curves.closest(points, owners)
    for number, (shape, ring) in enumerate(zip(shapes, closed, strict=True)):
        mine = owners == number
        alone = SplineCurves([shape], [ring]).closest(points[mine], zeros(12))
        torch.testing.assert_close(alone.distances, together.distances[mine], rtol=0, atol=1e-13)
    for row in range(0, len(owners), 7):
        single = curves.closest(points[row : row + 1], owners[row : row + 1])
        assert all(torch.equal(x[0], y[row]) for x, y in zip(single, together, strict=True))
    many = curves.closest(points.repeat(100, 1), owners.repeat(100))
    assert all(torch.equal(x[-len(owners) :], y) for x, y in zip(many, together, strict=True))


def test_feet_turn_shift_and_scale_with_the_curve_and_do_not_depend_on_its_direction() -> None:
    curve, turn = helix(5.0 * uneven(20, 5.0)), random_rotation(1)
    points = curve.repeat(3, 1) + noise(curve.repeat(3, 1), 0.1)
    found = SplineCurves([curve], [False]).closest(points, zeros(len(points)))
    place = lambda x: 100.0 * x @ turn.T - 40.0  # noqa: E731
    moved = SplineCurves([place(curve)], [False]).closest(place(points), zeros(len(points)))
    torch.testing.assert_close(moved.positions, place(found.positions), rtol=1e-12, atol=1e-10)
    torch.testing.assert_close(moved.tangents, found.tangents @ turn.T, rtol=0, atol=1e-11)
    torch.testing.assert_close(moved.curvatures, 0.01 * found.curvatures @ turn.T, rtol=0, atol=1e-11)
    back = SplineCurves([curve.flip(0)], [False]).closest(points, zeros(len(points)))
    torch.testing.assert_close(back.positions, found.positions, rtol=0, atol=1e-12)
    torch.testing.assert_close(back.tangents, -found.tangents, rtol=0, atol=1e-11)
    torch.testing.assert_close(back.curvatures, found.curvatures, rtol=0, atol=1e-11)
    assert torch.equal(back.beyond_end, found.beyond_end)


def test_single_precision_is_that_of_the_answer_only() -> None:
    curve = flower(40)
    points = (curve + noise(curve, 0.05)).float()
    single = SplineCurves([curve], [True]).closest(points, zeros(40).int())
    double = SplineCurves([curve], [True]).closest(points.double(), zeros(40))
    assert {x.dtype for x in single} == {torch.float32, torch.int64, torch.bool}
    for found, exact in zip(single, double, strict=True):
        assert torch.equal(found, exact.to(found.dtype))


def test_no_points_and_no_gradients() -> None:
    curves = SplineCurves([flower(6)], [True])
    none = curves.closest(torch.zeros(0, 3), zeros(0))
    assert none.positions.shape == none.curvatures.shape == (0, 3)
    feet = curves.closest(torch.ones(1, 3, requires_grad=True), zeros(1))
    assert not any(part.requires_grad for part in feet)


def test_nothing_depends_on_values_but_the_answer() -> None:
    """Fake tensors have no values: whatever asks for one, fails."""
    curves = SplineCurves([flower(200), helix(torch.arange(5, dtype=DOUBLE))], [True, False])
    owners = torch.arange(300) % 2
    real = curves.closest(torch.ones(300, 3), owners)
    with FakeTensorMode(allow_non_fake_inputs=True) as mode:
        feet = curves.closest(mode.from_tensor(torch.ones(300, 3)), mode.from_tensor(owners))
    for fake, part in zip(feet, real, strict=True):
        assert (fake.shape, fake.dtype) == (part.shape, part.dtype)


def test_points_that_are_not_finite_are_at_no_finite_distance() -> None:
    points = torch.tensor([[math.nan, 0, 0], [math.inf, 0, 0], [0.5, 0, 0]], dtype=DOUBLE)
    distances = SplineCurves([flower(200)], [True]).closest(points, zeros(3)).distances
    assert torch.isfinite(distances).tolist() == [False, False, True]


def test_wrong_shapes_are_refused() -> None:
    curves = SplineCurves([flower(6)], [True])
    for points in (torch.zeros(2, 2), torch.zeros(3), torch.zeros(2, 3, dtype=torch.int64)):
        with pytest.raises(ShapeError, match="points"):
            curves.closest(points, zeros(2))
    for owners in (zeros(1), zeros(2).float(), zeros(2).bool()):
        with pytest.raises(ShapeError, match="curves"):
            curves.closest(torch.zeros(2, 3), owners)
