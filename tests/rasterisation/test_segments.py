"""Edges cut into pieces, triangles that touch pixels, and what is seen beside edges: against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.rasterisation.crossings import cut_at_crossings
from torchfair.rasterisation.depth_keys import NO_KEY, depth_levels, key_bits, pack_keys, unpack_keys
from torchfair.rasterisation.runs import run_chunks
from torchfair.rasterisation.segments import Segments, pixel_segments
from torchfair.rasterisation.sides import STEP, seen_beside
from torchfair.rasterisation.touch import touched_spans

WIDTH, HEIGHT = 13, 9


def random_ends(count: int, seed: int, snap: bool = False) -> Tensor:
    """Edges in and around the picture; snapped ones start and end on corners and centres of pixels."""
    ends = np.random.default_rng(seed).uniform(-5, 18, (count, 2, 2))
    return torch.from_numpy(np.rint(2 * ends) / 2 if snap else ends)


def places(segments: Segments, ends: Tensor, positions: Tensor) -> Tensor:
    start = ends[segments.edge, 0]
    return start + positions[:, None] * (ends[segments.edge, 1] - start)


@pytest.mark.parametrize("snap", [False, True])
def test_segments_lie_in_their_pixel_and_make_up_the_visible_part_of_their_edge(snap: bool) -> None:
    ends, pictures = random_ends(80, 1, snap), torch.arange(80) % 3
    segments = pixel_segments(ends, pictures, WIDTH, HEIGHT)
    assert bool((segments.pixel.diff() >= 0).all())
    picture, row = segments.pixel // (WIDTH * HEIGHT), segments.pixel // WIDTH % HEIGHT
    assert torch.equal(picture, pictures[segments.edge])
    corner = torch.stack([segments.pixel % WIDTH, row], dim=1)
    for position in (segments.begin, segments.end):
        inside = places(segments, ends, position) - corner
        assert bool(((inside > -1e-9) & (inside < 1 + 1e-9)).all())
    along = (torch.arange(20000, dtype=DOUBLE) + 0.5) / 20000
    for edge in range(80):
        points = torch.lerp(ends[edge, 0], ends[edge, 1], along[:, None])
        visible = ((points > 0) & (points < torch.tensor([WIDTH, HEIGHT]))).all(1).to(DOUBLE).mean()
        mine = segments.edge == edge
        length = (segments.end - segments.begin)[mine].sum()
        on_border = bool((points[5:8] % 1 == 0).all(0).any())  # lies along a border of pixels
        assert abs(float(length - visible)) < 2e-4 or on_border
        starts, stops = segments.begin[mine].sort().values, segments.end[mine].sort().values
        assert torch.allclose(starts[1:], stops[:-1], atol=1e-12)


def test_crossings_cut_outlines_and_what_they_cross() -> None:
    """After the cut no segment of an outline and no other one cross inside, and nothing is lost."""
    ends, pictures = random_ends(40, 2), torch.zeros(40, dtype=torch.int64)
    outline = torch.arange(40) % 4 == 0
    whole = pixel_segments(ends, pictures, WIDTH, HEIGHT)
    cut = cut_at_crossings(whole, ends, outline, WIDTH * HEIGHT)
    for edge in range(40):
        lengths = [(s.end - s.begin)[s.edge == edge].sum() for s in (whole, cut)]
        assert torch.allclose(*lengths, atol=1e-12)
    assert bool((cut.pixel.diff() >= 0).all())
    assert len(cut.edge) > len(whole.edge)
    start, stop = places(cut, ends, cut.begin), places(cut, ends, cut.end)
    for number in torch.nonzero(outline[cut.edge]).squeeze(1).tolist():
        direction, offset = stop[number] - start[number], start - start[number]
        system = torch.stack([direction.expand_as(offset), start - stop], dim=-1)
        solvable = torch.linalg.det(system).abs() > 1e-9
        u, v = torch.linalg.solve(system[solvable], offset[solvable]).unbind(-1)
        assert not bool(((u > 1e-6) & (u < 1 - 1e-6) & (v > 1e-6) & (v < 1 - 1e-6)).any())


def random_corners(count: int, seed: int) -> Tensor:
    generator = np.random.default_rng(seed)
    centres = generator.uniform(-3, 15, (count, 1, 3))
    return torch.from_numpy(centres + generator.uniform(0.01, 6, (count, 1, 1)) * generator.normal(size=(count, 3, 3)))


def test_every_touched_pixel_is_found_and_few_others() -> None:
    corners = random_corners(60, 3)
    corners[0, :, 1] = 4.0  # level, along a border of pixels
    corners[1, :2, 1] = 5.5
    spans = touched_spans(corners[..., :2], WIDTH, HEIGHT)
    weights = torch.from_numpy(np.random.default_rng(0).dirichlet([0.7] * 3, 30000))
    found = torch.zeros(60, HEIGHT, WIDTH, dtype=torch.bool)
    for triangle, row, start, stop in zip(*(part.tolist() for part in spans), strict=True):
        found[triangle, row, start:stop] = True
    for triangle in range(60):
        points = weights @ corners[triangle, :, :2]
        column, row = points[((points >= 0) & (points < torch.tensor([WIDTH, HEIGHT]))).all(1)].long().unbind(1)
        assert bool(found[triangle, row, column].all())
        touched = torch.zeros(HEIGHT, WIDTH, dtype=torch.bool)
        touched[row, column] = True
        assert (found[triangle] & ~touched).sum() <= 2 + 0.1 * touched.sum() or triangle == 0


def test_what_is_seen_beside_edges_agrees_with_a_loop_over_triangles() -> None:
    corners, pictures = random_corners(60, 4), torch.arange(60) % 2
    sides = corners[:, [0, 1, 1, 2, 2, 0], :2].reshape(-1, 2, 2)
    segments = pixel_segments(sides, pictures.repeat_interleave(3), WIDTH, HEIGHT)
    seen = seen_beside(corners, pictures, segments, sides, (2, HEIGHT, WIDTH))
    along = sides[segments.edge, 1] - sides[segments.edge, 0]
    across = torch.stack([along[:, 1], -along[:, 0]], dim=1) / torch.linalg.vector_norm(along, dim=1, keepdim=True)
    middle = places(segments, sides, (segments.begin + segments.end) / 2)
    system = torch.cat([corners[..., :2], torch.ones(60, 3, 1, dtype=DOUBLE)], dim=2).mT
    for side, sign in ((0, -1), (1, 1)):
        points = torch.cat([middle + sign * STEP * across, torch.ones(len(middle), 1, dtype=DOUBLE)], dim=1)
        weights = (torch.linalg.inv(system) @ points.T).mT  # (triangle, place, 3)
        depth = (weights * corners[:, None, :, 2]).sum(-1)
        hit = (weights >= 0).all(-1) & (pictures[:, None] == segments.pixel // (WIDTH * HEIGHT))
        depth = torch.where(hit, depth, torch.inf)
        expected = torch.where(hit.any(0), depth.argmin(0), -1)
        assert (seen[:, side] == expected).to(DOUBLE).mean() > 0.998  # rounding at corners of the middle of a segment


def test_keys_order_by_depth_then_number() -> None:
    depth = torch.tensor([0.25, 0.25, 1.0, 0.0, 3.0], dtype=DOUBLE)
    picture = torch.tensor([0, 0, 0, 0, 1])
    bits = key_bits(5)
    origin, scale = depth_levels(depth, depth, picture, 2, bits)
    keys = pack_keys((depth - origin[picture]) * scale[picture], torch.arange(5), bits)
    assert keys[:4].argsort().tolist() == [3, 0, 1, 2]
    assert int(keys.min()) >= 0
    assert unpack_keys(torch.cat([keys, torch.tensor([NO_KEY])]), bits).tolist() == [0, 1, 2, 3, 4, -1]


@pytest.mark.parametrize("chunk", [1, 4, 1000])
def test_runs_in_chunks(chunk: int) -> None:
    begin, length = torch.tensor([5, 0, 7, 2]), torch.tensor([3, 0, 1, 9])
    parts = list(run_chunks(begin, length, chunk))
    expected = [(item, number) for item in range(4) for number in range(begin[item], begin[item] + length[item])]
    assert [pair for part in parts for pair in zip(*(p.tolist() for p in part), strict=True)] == expected
    assert list(run_chunks(begin[:0], length[:0], chunk)) == []
