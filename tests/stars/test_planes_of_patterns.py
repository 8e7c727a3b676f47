"""Which patterns of sides planes may show: all that random planes do, few others, and no class depends on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from star_tools import directions, random_arms, stars_of

from torchfair.stars import _judge, classify_stars
from torchfair.stars._patterns import four_run_patterns
from torchfair.stars._planes import planes_may_show


def level_arms(count: int, valence: int, height: float) -> np.ndarray:
    """Regular stars of three heights only: many planes through two edges contain others too."""
    angles = np.arange(valence) * 2 * math.pi / valence
    heights = height * np.random.default_rng(valence).integers(-1, 2, (count, valence))
    flat = np.broadcast_to(np.stack([np.cos(angles), np.sin(angles)], axis=1), (count, valence, 2))
    return np.concatenate([flat, heights[..., None]], axis=2)


@pytest.mark.parametrize("valence", [4, 5, 6, 8])
def test_no_pattern_that_a_plane_has_is_excluded_and_most_others_are(valence: int) -> None:
    arms = np.concatenate([random_arms(30, valence, seed=valence, height=0.5), level_arms(30, valence, 0.5)])
    unit = torch.from_numpy(arms / np.linalg.norm(arms, axis=2, keepdims=True))
    patterns = four_run_patterns(valence).signs
    heights = torch.einsum("pc,nkc->npk", torch.from_numpy(directions(20_000)), unit)
    shown = torch.stack([((heights * row) > 0).all(2).any(1) for row in patterns], dim=1)
    may = planes_may_show(unit, patterns)
    assert int(shown.sum()) > 30
    assert not bool((shown & ~may).any())
    most = valence * (valence - 1) + 2  # patterns of planes in general position, two of which have one run
    assert bool((may[:30].sum(1) <= most - 2).all())
    if valence > 5:
        assert int(may[:30].sum()) < patterns.shape[0] * 30 / 2


def test_edges_in_one_plane_and_parallel_ones_exclude_nothing() -> None:
    flat = torch.tensor([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], dtype=torch.float64)
    patterns = four_run_patterns(4).signs
    assert bool(planes_may_show(flat[None], patterns).all())
    parallel = torch.tensor([[1.0, 0, 0.1], [1, 0, 0.1], [-1, 0, 0.1], [0, -1, 0.1]], dtype=torch.float64)
    assert bool(planes_may_show(parallel[None] / math.sqrt(1.01), patterns).all())


@pytest.mark.parametrize("gap", [1e-9, 1e-13, 1e-16])
def test_two_edges_that_are_nearly_one_exclude_no_pattern_of_planes_but_most_others(gap: float) -> None:
    """The plane through both is rounding; those through one of them and another edge tell as much."""
    arms = random_arms(30, 7, seed=3, height=0.5)
    arms[:, 1] = arms[:, 2] + gap * np.random.default_rng(1).normal(size=(30, 3))
    unit = torch.from_numpy(arms / np.linalg.norm(arms, axis=2, keepdims=True))
    patterns = four_run_patterns(7).signs
    heights = torch.einsum("pc,nkc->npk", torch.from_numpy(directions(20_000)), unit)
    shown = torch.stack([((heights * row) > 0).all(2).any(1) for row in patterns], dim=1)
    may = planes_may_show(unit, patterns)
    assert not bool((shown & ~may).any())
    if gap > 1e-15:  # else both may be the same, whose plane excludes nothing
        assert int(may.sum()) < patterns.shape[0] * 30 / 2


@pytest.mark.parametrize("valence", [5, 6, 7, 8])
@pytest.mark.parametrize("height", [0.5, 1e-3, 1e-7, 1e-9, 1e-13, 1e-16])
def test_classes_are_those_of_trying_every_pattern(
    valence: int, height: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = random_arms(60, valence, seed=valence, height=height, saddle=height / 2)
    thin = random_arms(60, valence, seed=valence, height=0.5)
    thin[:, 1] = thin[:, 2] + height * np.random.default_rng(1).normal(size=(60, 3))
    vertices, topology = stars_of(np.concatenate([random, level_arms(60, valence, height), thin]))
    quick = classify_stars(vertices, topology)
    monkeypatch.setattr(
        _judge, "planes_may_show", lambda arms, patterns: torch.ones(len(arms), len(patterns), dtype=torch.bool)
    )
    careful = classify_stars(vertices, topology)
    assert torch.equal(quick.kinds, careful.kinds)
    assert torch.equal(quick.good, careful.good)
    assert torch.equal(quick.sides, careful.sides)
    torch.testing.assert_close(quick.normals, careful.normals, atol=1e-12, rtol=0)
