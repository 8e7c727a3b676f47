from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.rasterisation.quads import parallelogram_spans
from torchfair.rasterisation.scan import triangle_spans

WIDTH, HEIGHT = 37, 29


def counts(x: Tensor, y: Tensor) -> Tensor:
    """How often each of (n, HEIGHT, WIDTH) pixels of parallelograms (4, n) is in one of their runs."""
    covered = torch.zeros(x.shape[1], HEIGHT, WIDTH, dtype=torch.int64)
    for quad, row, start, length in zip(
        *(part.tolist() for part in parallelogram_spans(x, y, WIDTH, HEIGHT)), strict=True
    ):
        covered[quad, row, start : start + length] += 1
    return covered


def by_triangles(x: Tensor, y: Tensor) -> Tensor:
    """The same, of the two triangles of each."""
    points = torch.stack([x.T, y.T, torch.zeros_like(x.T)], dim=-1).view(-1, 3)
    first = 4 * torch.arange(x.shape[1])[:, None]
    triangles = torch.cat([first, first + 1, first + 2, first, first + 2, first + 3], dim=1).view(-1, 3)
    covered = torch.zeros(x.shape[1], HEIGHT, WIDTH, dtype=torch.int64)
    for spans in triangle_spans(points, triangles, WIDTH, HEIGHT):
        for triangle, row, start, length in zip(*(part.tolist() for part in spans[:4]), strict=True):
            covered[triangle // 2, row, start : start + length] += 1
    return covered


def parallelograms(origins: Tensor, one: Tensor, other: Tensor) -> tuple[Tensor, Tensor]:
    """Corners x and y (4, n) with sides (n, 2) at origins (n, 2)."""
    corners = torch.stack([origins, origins + one, origins + one + other, origins + other])
    return corners[..., 0], corners[..., 1]


def random_parallelograms(count: int) -> tuple[Tensor, Tensor]:
    """Of all sizes, some of no area, some outside of the screen."""
    generator = torch.Generator().manual_seed(0)
    origins = 50.0 * torch.rand(count, 2, generator=generator, dtype=DOUBLE) - 8.0
    sides = torch.randn(2, count, 2, generator=generator, dtype=DOUBLE)
    sides *= torch.logspace(-1.0, 1.5, count, dtype=DOUBLE)[:, None]
    sides[1, ::20] = 0.0
    return parallelograms(origins, *sides)


def test_runs_are_those_of_its_two_triangles_joined() -> None:
    x, y = random_parallelograms(300)
    covered = counts(x, y)
    assert torch.equal(covered, by_triangles(x, y))
    assert int(covered.max()) == 1
    assert int(covered.any(2).any(1).sum()) > 100


@pytest.mark.parametrize("turn", range(4))
def test_any_corner_may_be_the_first_and_they_may_run_both_ways(turn: int) -> None:
    x, y = random_parallelograms(100)
    expected = counts(x, y)
    assert torch.equal(counts(x.roll(turn, 0), y.roll(turn, 0)), expected)
    assert torch.equal(counts(x.flip(0).roll(turn, 0), y.flip(0).roll(turn, 0)), expected)


@pytest.mark.parametrize("sides", [((4, 0), (0, 3)), ((2.5, 1), (-1, 2.5)), ((3, 3), (-0.5, 0.5)), ((6, 1), (5, -2))])
def test_a_lattice_covers_every_pixel_once(sides: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Also centres of pixels that lie on sides and corners, as many do here."""
    one, other = torch.tensor(sides, dtype=DOUBLE)
    reach = torch.arange(-40.0, 41.0, dtype=DOUBLE)
    origins = (reach[:, None, None] * one + reach[None, :, None] * other).view(-1, 2) + 0.5
    covered = counts(*parallelograms(origins, one.expand_as(origins), other.expand_as(origins))).sum(0)
    near = 0
    for row in range(HEIGHT):
        for column in range(WIDTH):
            offset = torch.tensor([column + 0.5, row + 0.5], dtype=DOUBLE) - 0.5
            if torch.linalg.solve(torch.stack([one, other], 1), offset).abs().max() < 39.0:
                near += 1
                assert covered[row, column] == 1
    assert near > 0.5 * WIDTH * HEIGHT


def test_nothing_of_none() -> None:
    nothing = torch.zeros(4, 0, dtype=DOUBLE)
    assert len(parallelogram_spans(nothing, nothing, WIDTH, HEIGHT).row) == 0
