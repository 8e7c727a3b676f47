"""Zeros among signs, thin cones, stars that run around twice, and how small a defect or a crossing may be."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE

from torchfair import Topology
from torchfair.geometry import angle_defects
from torchfair.stars import StarKind, classify_stars, pyramid_self_intersections
from torchfair.stars._cones import interior_directions
from torchfair.stars._patterns import fill_zeros


def test_zeros_take_the_sign_before_or_after_them() -> None:
    signs = torch.tensor([[1, 0, -1, 0, 0], [0, 0, 1, -1, 0], [0, 0, 0, 0, 0]])
    before = [[1, 1, -1, -1, -1], [-1, -1, 1, -1, -1], [0] * 5]
    after = [[1, -1, -1, 1, 1], [1, 1, 1, -1, 1], [0] * 5]
    assert fill_zeros(signs).tolist() == before
    assert fill_zeros(signs, shift=-1).tolist() == after


def test_flat_stars_have_no_sign_of_the_angle_defect_whichever_way_they_lie() -> None:
    """What rounding of the corner angles makes of zero is no sign; a defect of a millionth is one."""
    generator = torch.Generator().manual_seed(3)
    angles = torch.arange(7) * (math.tau / 7) + 0.3 * torch.rand(300, 7, dtype=DOUBLE, generator=generator)
    seen = []
    flat = torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], dim=-1)
    flat = torch.cat([torch.zeros(300, 1, 3, dtype=DOUBLE), flat], dim=1)
    turn = torch.linalg.qr(torch.randn(3, 3, dtype=DOUBLE, generator=generator)).Q
    topology = Topology.from_faces([[0, 1 + i, 1 + (i + 1) % 7] for i in range(7)])
    for star in flat @ turn:
        assert int(classify_stars(star, topology).defect_signs[0]) == 0
        seen.append(float(angle_defects(star, topology)[0]))
    assert sum(defect != 0.0 for defect in seen) > 50
    cone = flat[0] + 1e-3 * torch.tensor([0.0, 0, 1], dtype=DOUBLE) * (torch.arange(8) > 0)[:, None]
    assert int(classify_stars(cone, topology).defect_signs[0]) == 1


def test_stars_that_run_around_twice_are_neither_convex_nor_saddles() -> None:
    """Seen along the axis of a cone that is covered twice every sector is turned the same way."""
    topology = Topology.from_faces([[0, 1 + i, 1 + (i + 1) % 10] for i in range(10)])
    for rounds, kind in ((1, StarKind.CONVEX), (2, StarKind.NEITHER)):
        angles = torch.arange(10, dtype=DOUBLE) * (rounds * math.tau / 10)
        ring = torch.stack([angles.cos(), angles.sin(), torch.full_like(angles, -0.5)], dim=-1)
        star = torch.cat([torch.zeros(1, 3, dtype=DOUBLE), ring])
        assert int(classify_stars(star, topology).kinds[0]) == int(kind)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-7])
def test_a_direction_is_found_inside_a_thin_cone(width: float) -> None:
    """Three walls around an axis, each nearly along it; with the axis excluded by a fourth one it is empty."""
    turns = torch.arange(3, dtype=DOUBLE) * (math.tau / 3)
    around = torch.stack([turns.cos(), turns.sin(), torch.full_like(turns, width)], dim=1)
    walls = around / torch.linalg.vector_norm(around, dim=1, keepdim=True)
    above = torch.tensor([[0.0, 0.0, 1.0]], dtype=DOUBLE)
    directions, margins = interior_directions(walls[None])
    torch.testing.assert_close(directions, above, atol=0.1 * width, rtol=0)
    assert float(margins) == pytest.approx(width, rel=0.1)
    assert float(interior_directions(torch.cat([walls, -above])[None])[1]) <= 0.0


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
