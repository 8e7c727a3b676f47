"""Strips on the sheet cover neither themselves nor each other."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from helpers import DOUBLE
from hypothesis import given, settings
from hypothesis import strategies as st
from principal_lattices import LATTICES
from torch import Tensor

from torchfair import TorchfairError
from torchfair.principal import DevelopableStrips, developable_strips, principal_edges_of_lattice
from torchfair.principal._overlaps import overlaps, pieces
from torchfair.principal._sheet import shelves, upright
from torchfair.principal._unroll import quads_of


def common_area(one: np.ndarray, other: np.ndarray) -> float:
    """Of two convex polygons, counterclockwise: cuts one with the sides of the other."""
    rest = [complex(*p) for p in one]
    for a, b in itertools.pairwise([complex(*p) for p in (*other, other[0])]):
        heights = [((p - a) * (b - a).conjugate()).imag for p in rest]
        cut = []
        for i in range(len(rest)):
            p, q, hp, hq = rest[i - 1], rest[i], heights[i - 1], heights[i]
            if (hp > 0) != (hq > 0):
                cut.append(p + (q - p) * hp / (hp - hq))
            if hq > 0:
                cut.append(q)
        rest = cut
    return 0.5 * sum((p.conjugate() * q).imag for p, q in zip(rest, [*rest[1:], *rest[:1]], strict=True))


def walk(seed: int, count: int = 40) -> np.ndarray:
    """Rulings (n, 2, 2) of a flat strip of convex quads that turns at random."""
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.uniform(-0.6, 0.6) + rng.uniform(-0.3, 0.3, count))
    step = np.exp(1j * (turn + rng.uniform(-0.05, 0.05, count)))
    across = 1j * np.exp(1j * turn)
    middle = np.cumsum(step)
    lower, upper = middle - 0.3 * across, middle + 0.3 * across
    points = np.stack([lower, upper], axis=1)
    return np.stack([points.real, points.imag], axis=2)


def spiral(
    turns: float, *, per_turn: int = 24, radius: float = 2.0, drift: float = 0.0
) -> tuple[Tensor, Tensor, Tensor]:
    """A flat curve that winds round, its normals outwards, and the polyline along it."""
    angle = torch.arange(round(turns * per_turn) + 1, dtype=DOUBLE) * (math.tau / per_turn)
    outward = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=1)
    return (radius + drift * angle)[:, None] * outward, outward, torch.arange(len(angle))


def assert_nothing_covered(strips: DevelopableStrips) -> None:
    quads = strips.uv[strips.topology.corners.view(-1, 4)].numpy()
    for i, j in itertools.combinations(range(len(quads)), 2):
        assert common_area(quads[i], quads[j]) < 1e-6


# ---- strips that overlap themselves ----------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
def test_overlaps_against_slow_clipping(seed: int) -> None:
    flat = walk(seed)
    quads = quads_of(flat)
    slow = [
        (i, j)
        for i, j in itertools.combinations(range(len(quads)), 2)
        if j > i + 1 and common_area(quads[i], quads[j]) > 1e-9
    ]
    assert sorted(map(tuple, overlaps(flat).tolist())) == slow


def test_quads_with_one_other_between_them_can_overlap() -> None:
    """Three quads that turn by 150 degrees each around a point: the last lies over the first."""
    turn = np.exp(-1j * np.radians([0.0, 150.0, 300.0, 450.0]))
    points = np.stack([0.5 * turn, turn], axis=1)
    flat = np.stack([points.real, points.imag], axis=2)
    first, _, last = quads_of(flat)
    assert common_area(first, last) > 0.01
    assert overlaps(flat).tolist() == [[0, 2]]
    assert pieces(flat) == [0, 2, 3]


def test_some_of_these_walks_overlap_and_some_do_not() -> None:
    assert {bool(len(overlaps(walk(seed)))) for seed in range(12)} == {False, True}


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 120))
def test_pieces_do_not_overlap_themselves(seed: int, count: int) -> None:
    flat = walk(seed, count + 1)
    cuts = pieces(flat)
    assert cuts[0] == 0
    assert cuts[-1] == count
    assert all(a < b for a, b in itertools.pairwise(cuts))
    for a, b in itertools.pairwise(cuts):
        assert not len(overlaps(flat[a : b + 1]))


@pytest.mark.parametrize(
    ("turns", "names"), [(0.9, ("1",)), (1.0, ("1",)), (1.5, ("1a", "1b")), (2.9, ("1a", "1b", "1c"))]
)
def test_strips_that_wind_round_are_cut_into_equal_pieces(turns: float, names: tuple[str, ...]) -> None:
    points, normals, line = spiral(turns)
    strips = developable_strips(points, [line], normals, 0.5)
    assert strips.names == names
    assert strips.polylines.tolist() == [0] * len(names)
    quads = strips.offsets.diff() - 1
    assert quads.sum() == len(line) - 1
    assert quads.amax() - quads.amin() <= 1
    assert_nothing_covered(strips)


def test_a_spiral_with_room_between_its_windings_stays_whole() -> None:
    assert developable_strips(*_lined(spiral(2.5, drift=0.1)), 0.5).names == ("1",)
    tight = developable_strips(*_lined(spiral(2.5, drift=0.07)), 0.5)
    assert len(tight.names) > 1
    assert_nothing_covered(tight)


def _lined(curve: tuple[Tensor, Tensor, Tensor]) -> tuple[Tensor, list[Tensor], Tensor]:
    points, normals, line = curve
    return points, [line], normals


# ---- the sheet -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LATTICES)
def test_strips_lie_apart_on_the_sheet(name: str) -> None:
    mesh, _ = LATTICES[name]
    gap = 0.04
    lines = principal_edges_of_lattice(mesh).polylines()
    strips = developable_strips(mesh.vertices, lines, mesh.normals, 0.2, gap=gap)
    low = torch.stack([outline.amin(0) for outline in strips.outlines()])
    high = torch.stack([outline.amax(0) for outline in strips.outlines()])
    assert (low >= gap - 1e-9).all()
    assert (high <= torch.tensor(strips.sheet, dtype=DOUBLE) - gap + 1e-9).all()
    apart = torch.maximum(low[:, None] - high, low - high[:, None]).amax(-1) >= gap - 1e-9
    assert (apart | torch.eye(len(low), dtype=torch.bool)).all()


@settings(max_examples=50, deadline=None)
@given(
    boxes=st.lists(st.tuples(st.floats(0.1, 9), st.floats(0.1, 9)), min_size=1, max_size=25),
    gap=st.floats(0, 1),
    width=st.one_of(st.none(), st.floats(11, 40)),
)
def test_shelves_hold_all_boxes(boxes: list[tuple[float, float]], gap: float, width: float | None) -> None:
    sizes = np.array(boxes)
    layout = shelves(sizes, gap, width)
    ends = layout.corners + sizes
    assert (layout.corners >= gap - 1e-9).all()
    assert (ends <= np.array([layout.width, layout.height]) - gap + 1e-6).all()
    apart = np.maximum(layout.corners[:, None] - ends, layout.corners - ends[:, None]).max(2) >= gap - 1e-6
    assert (apart | np.eye(len(sizes), dtype=bool)).all()
    assert width is None or layout.width == width


@pytest.mark.parametrize("seed", range(4))
def test_the_sheet_without_a_given_width_is_the_smallest_of_those_from_square_to_twice_as_broad(seed: int) -> None:
    sizes = np.random.default_rng(seed).uniform(0.2, 3.0, (30, 2))
    gap = 0.1
    chosen = shelves(sizes, gap, None)
    square = math.sqrt(float((sizes + gap).prod(1).sum()))
    narrowest = float(sizes[:, 0].max()) + 2 * gap
    areas = [step * square / 8 * shelves(sizes, gap, max(narrowest, step * square / 8)).height for step in range(8, 17)]
    assert chosen.width * chosen.height <= min(areas) * (1 + 1e-9)
    assert chosen.width * chosen.height < max(areas)
    assert chosen.width <= 2 * square


@pytest.mark.parametrize("seed", range(6))
def test_bounding_boxes_are_smallest(seed: int) -> None:
    flat = walk(seed)
    turned = upright(flat)
    width, height = turned.max((0, 1))
    assert width >= height
    assert np.allclose(turned.min((0, 1)), 0)
    points = flat.reshape(-1, 2) @ np.array([1, 1j])
    for angle in np.linspace(0, math.pi, 200):
        turn = points * np.exp(1j * angle)
        assert np.ptp(turn.real) * np.ptp(turn.imag) >= width * height * (1 - 1e-9)
    moved = turned.reshape(-1, 2) @ np.array([1, 1j])
    ratio = (moved - moved[0])[1:] / (points - points[0])[1:]
    assert np.allclose(ratio, ratio[0])  # a rotation: not mirrored
    assert abs(ratio[0]) == pytest.approx(1)


def test_strips_too_long_for_the_sheet_are_halved() -> None:
    points = torch.stack([torch.arange(33, dtype=DOUBLE), torch.zeros(33), torch.zeros(33)], dim=1)
    normals = torch.tensor([0.0, 0, 1], dtype=DOUBLE).expand(33, 3)
    line = torch.arange(33)
    strips = developable_strips(points, [line], normals, 0.5, sheet_width=12, gap=0.25)
    assert strips.names == ("1a", "1b", "1c", "1d")
    assert strips.offsets.tolist() == [0, 9, 18, 27, 36]
    assert strips.sheet == pytest.approx((12, 4 * 0.5 + 5 * 0.25))
    whole = developable_strips(points, [line], normals, 0.5, sheet_width=32.5, gap=0.25)
    assert whole.names == ("1",)
    with pytest.raises(TorchfairError, match=r"sheet_width: a strip needs 1\.5 with gaps, the sheet has 1\.4"):
        developable_strips(points, [line], normals, 0.5, sheet_width=1.4, gap=0.25)


def straight(length: int) -> tuple[Tensor, list[Tensor], Tensor]:
    """A line of edges of length 1 with upright normals: its strip is a rectangle."""
    points = torch.stack([torch.arange(length + 1, dtype=DOUBLE), *torch.zeros(2, length + 1, dtype=DOUBLE)], dim=1)
    return points, [torch.arange(length + 1)], torch.tensor([0.0, 0, 1], dtype=DOUBLE).expand(length + 1, 3)


@pytest.mark.parametrize("room", [-0.01, 0.01, 0.3, 0.49, 0.51])
def test_a_strip_stays_whole_exactly_if_there_is_a_gap_at_both_of_its_ends(room: float) -> None:
    strips = developable_strips(*straight(32), 0.5, sheet_width=32.0 + room, gap=0.25)
    assert strips.offsets.diff().tolist() == ([33] if room >= 0.5 else [17, 17])
    if room < 0.5:  # two rows
        assert strips.sheet == pytest.approx((32.0 + room, 2 * 0.5 + 3 * 0.25))


def test_the_gap_is_a_quarter_of_the_width_of_the_strips_unless_given() -> None:
    for gap, expected in ((None, (0.3 + 0.1) / 4), (0.0, 0.0), (0.7, 0.7)):
        strips = developable_strips(*straight(5), 0.3, depth=0.1, gap=gap)
        assert strips.sheet == pytest.approx((5.0 + 2.0 * expected, 0.4 + 2.0 * expected))


def test_more_pieces_than_letters() -> None:
    points = torch.stack([torch.arange(61, dtype=DOUBLE), torch.zeros(61), torch.zeros(61)], dim=1)
    normals = torch.tensor([0.0, 0, 1], dtype=DOUBLE).expand(61, 3)
    strips = developable_strips(points, [torch.arange(61)], normals, 0.5, sheet_width=1.1, gap=0.0)
    assert strips.names[0] == "1a"
    assert strips.names[24:29] == ("1y", "1z", "1aa", "1ab", "1ac")
    assert len(set(strips.names)) == 60
