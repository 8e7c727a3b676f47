"""Zeros among signs, and how small a crossing of a normal pyramid may be to be seen."""

from __future__ import annotations

import math

import torch
from helpers import DOUBLE

from torchfair import Topology
from torchfair.stars import pyramid_self_intersections
from torchfair.stars._patterns import fill_zeros


def test_zeros_take_the_sign_before_or_after_them() -> None:
    signs = torch.tensor([[1, 0, -1, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 0, 0]])
    before = [[1, 1, -1, -1, -1], [-1, -1, 1, -1, -1], [0] * 5]
    after = [[1, -1, -1, 1, 1], [1, 1, 1, -1, 1], [0] * 5]
    assert fill_zeros(signs).tolist() == before
    assert fill_zeros(signs, shift=-1).tolist() == after


def test_crossings_are_seen_in_stars_that_are_flat_to_ten_digits() -> None:
    """Heights are exact however small; only what rounding of coordinates may turn is in doubt."""
    generator = torch.Generator().manual_seed(5)
    angles = torch.arange(7, dtype=DOUBLE) * (math.tau / 7)
    heights = torch.randn(200, 7, dtype=DOUBLE, generator=generator)
    topology = Topology.from_faces([[0, 1 + i, 1 + (i + 1) % 7] for i in range(7)])
    counts = []
    for scale in (1e-3, 1e-10):
        ring = torch.stack([angles.cos().expand(200, 7), angles.sin().expand(200, 7), scale * heights], dim=-1)
        stars = torch.cat([torch.zeros(200, 1, 3, dtype=DOUBLE), ring], dim=1)
        counts.append(pyramid_self_intersections(stars, topology)[:, 0])
    assert int((counts[0] > 0).sum()) > 20
    assert int((counts[0] != counts[1]).sum()) <= 2
