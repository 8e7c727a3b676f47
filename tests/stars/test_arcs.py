"""What rounding and noise may do to arcs: they make no crossing, and hide none that is wider than they are."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from torch import Tensor

from torchfair.stars import arc_crossings

SIZES = [0.5, 1e-2, 1e-5]
SEEDS = range(40)


def place(longitude: float, latitude: float) -> list[float]:
    return [
        math.cos(latitude) * math.cos(longitude),
        math.cos(latitude) * math.sin(longitude),
        math.sin(latitude),
    ]


def two_arcs(size: float, *, beyond: float = 0.0, towards: float = 0.0, seed: int = 0, where: float = 0.3) -> Tensor:
    """Arcs ab and cd of a spherical quadrangle abcd, ab along the equator, turned at random.

    d lies ``beyond`` the equator, seen from c, and a and b move ``towards`` c; all zero, d touches ab. The two other
    arcs never meet.
    """
    rows = [(-size, towards), (size, towards), (where * size, size), (where * size, -beyond)]
    return torch.tensor([place(*row) for row in rows], dtype=DOUBLE) @ random_rotation(seed).T


def crossings(points: Tensor, noise: float = 0.0) -> int:
    return int(arc_crossings(points, noise).sum()) // 2


@pytest.mark.parametrize("dtype", [DOUBLE, torch.float32])
@pytest.mark.parametrize("size", SIZES)
def test_arcs_that_touch_do_not_cross_however_their_points_are_rounded(size: float, dtype: torch.dtype) -> None:
    touching = torch.stack([two_arcs(size, seed=seed) for seed in SEEDS]).to(dtype)
    assert not bool(arc_crossings(touching).any())


@pytest.mark.parametrize("size", SIZES)
def test_arcs_cross_that_cross_by_twenty_rounding_errors(size: float) -> None:
    for dtype in (DOUBLE, torch.float32):
        width = 20 * torch.finfo(dtype).eps
        if size > 10 * width:
            assert all(crossings(two_arcs(size, beyond=width, seed=seed).to(dtype)) == 1 for seed in SEEDS)


@pytest.mark.parametrize("where", [-0.9, 0.0, 0.3, 0.9])
@pytest.mark.parametrize("size", [0.1, 1e-3])
def test_points_that_are_wrong_by_the_noise_make_no_crossing_and_by_a_little_more_they_do(
    size: float, where: float
) -> None:
    """The worst that can happen to arcs that touch: the end of one moves on, and both ends of the other against it."""
    for wrong in (1e-9, 1e-2 * size):
        for seed in SEEDS:
            points = two_arcs(size, beyond=wrong, towards=wrong, seed=seed, where=where)
            assert crossings(points) == 1
            assert crossings(points, 1.1 * wrong) == 0
            assert crossings(points, 0.9 * wrong) == 1


def test_polygons_have_a_noise_each() -> None:
    points = two_arcs(0.1, beyond=1e-4)
    noise = torch.tensor([[1e-6, 1e-3], [1e-3, 1e-6]], dtype=DOUBLE)
    found = arc_crossings(points.expand(2, 2, 4, 3), noise).flatten(2).any(-1)
    assert found.tolist() == [[True, False], [False, True]]


def test_noise_takes_crossings_away_but_makes_none() -> None:
    points = torch.nn.functional.normalize(
        torch.randn(200, 6, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(1)), dim=-1
    )
    before = arc_crossings(points)
    for noise in (1e-3, 1e-2, 1e-1):
        after = arc_crossings(points, noise)
        assert not bool((after & ~before).any())
        assert int(after.sum()) < int(before.sum())
        before = after
    assert not bool(arc_crossings(points, math.inf).any())
