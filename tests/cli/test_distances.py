"""Distances of named places from segments, and whether the nearest of several is clearly meant."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE

from torchfair.cli.distances import from_segments, two_nearest


def test_distances_from_segments_are_those_from_many_points_on_them() -> None:
    generator = torch.Generator().manual_seed(3)
    segments = torch.randn((12, 2, 3), dtype=DOUBLE, generator=generator)
    place = torch.randn(3, dtype=DOUBLE, generator=generator)
    share = torch.linspace(0, 1, 100_001, dtype=DOUBLE)[:, None, None]
    points = segments[:, 0] + share * (segments[:, 1] - segments[:, 0])
    sampled = (points - place).norm(dim=2).min(0).values
    torch.testing.assert_close(from_segments(place, segments), sampled, rtol=1e-8, atol=0)


def test_beyond_its_ends_a_segment_is_as_far_as_its_end_and_one_of_no_length_as_its_point() -> None:
    segments = torch.tensor([[[0, 0, 0], [1, 0, 0]], [[2, 0, 0], [3, 0, 0]], [[5, 4, 0], [5, 4, 0]]], dtype=DOUBLE)
    place = torch.tensor([5.0, 0.0, 0.0], dtype=DOUBLE)
    torch.testing.assert_close(from_segments(place, segments), torch.tensor([4.0, 2.0, 4.0], dtype=DOUBLE))
    torch.testing.assert_close(from_segments(-place, segments)[:2], torch.tensor([5.0, 7.0], dtype=DOUBLE))


@pytest.mark.parametrize(("second", "clear"), [(1.2, False), (1.26, True), (1.0, False), (9.0, True)])
def test_the_nearest_is_meant_below_four_fifths_of_the_distance_of_the_second(second: float, clear: bool) -> None:
    numbers, near, sure = two_nearest(torch.tensor([9.5, second, 1.0], dtype=DOUBLE))
    assert sorted(numbers) == [1, 2]
    assert near == [1.0, second]
    assert sure is clear


def test_the_only_one_is_always_meant() -> None:
    assert two_nearest(torch.tensor([7.0], dtype=DOUBLE)) == ([0], [7.0], True)
