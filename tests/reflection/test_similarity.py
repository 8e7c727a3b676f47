"""Structural similarity of pictures against a plain reference, and its properties."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from torchfair.reflection._comparison import dissimilarity
from torchfair.reflection._similarity import WINDOW, structural_similarity


def pictures(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def plain(first: list[list[float]], second: list[list[float]], row: int, column: int) -> float:
    """Of the square whose first pixel is given, with central moments, pixel by pixel."""
    places = [(i, j) for i in range(WINDOW) for j in range(WINDOW)]
    weights = [math.exp(-((i - 5) ** 2 + (j - 5) ** 2) / (2 * 1.5**2)) for i, j in places]
    weights = [weight / sum(weights) for weight in weights]
    x, y = ([picture[row + i][column + j] for i, j in places] for picture in (first, second))

    def mean(values: list[float]) -> float:
        return sum(w * value for w, value in zip(weights, values, strict=True))

    a, b = mean(x), mean(y)
    spread = mean([(value - a) ** 2 for value in x]) + mean([(value - b) ** 2 for value in y])
    common = mean([(value - a) * (other - b) for value, other in zip(x, y, strict=True)])
    return (2 * a * b + 1e-4) * (2 * common + 9e-4) / ((a**2 + b**2 + 1e-4) * (spread + 9e-4))


def test_every_pixel_is_as_the_definition_says() -> None:
    first, second = pictures(14, 12), pictures(14, 12, seed=1)
    found = structural_similarity(first, second)
    assert found.shape == (4, 2)
    expected = [[plain(first.tolist(), second.tolist(), row, column) for column in range(2)] for row in range(4)]
    torch.testing.assert_close(found, torch.tensor(expected, dtype=torch.float64), rtol=1e-12, atol=1e-12)


def test_it_is_one_for_the_same_symmetric_and_turns_with_the_pictures() -> None:
    first, second = pictures(2, 3, 20, 17), pictures(2, 3, 20, 17, seed=1)
    one = torch.ones(2, 3, 10, 7, dtype=torch.float64)
    torch.testing.assert_close(structural_similarity(first, first), one, rtol=1e-12, atol=1e-12)
    found = structural_similarity(first, second)
    torch.testing.assert_close(structural_similarity(second, first), found, rtol=1e-12, atol=1e-12)
    assert found.abs().max() < 1.0
    torch.testing.assert_close(structural_similarity(first.mT, second.mT), found.mT, rtol=1e-12, atol=1e-12)
    black = torch.zeros(1, 15, 15, dtype=torch.float64)
    assert torch.equal(structural_similarity(black, black), torch.ones(1, 5, 5, dtype=torch.float64))


def test_batches_are_pictures_by_themselves_and_have_derivatives() -> None:
    first, second = pictures(2, 3, 13, 12), pictures(2, 3, 13, 12, seed=1)
    found = structural_similarity(first, second)
    torch.testing.assert_close(found[1, 2], structural_similarity(first[1, 2], second[1, 2]), rtol=1e-12, atol=1e-12)
    assert torch.autograd.gradcheck(structural_similarity, (first[0, :1].requires_grad_(), second[0, :1]))


@pytest.mark.parametrize(("size", "expected"), [(WINDOW - 1, 0.0), (WINDOW, None)])
def test_pictures_smaller_than_a_square_are_not_compared(size: int, expected: float | None) -> None:
    first, second = pictures(1, 1, size, size), pictures(1, 1, size, size, seed=1)
    window = torch.zeros(1, size, size, dtype=torch.bool)
    window[0, WINDOW // 2 :, WINDOW // 2 :] = size >= WINDOW  # pixels whose square is not inside are not counted
    found = dissimilarity(first, second, window)
    if expected is None:
        expected = 1.0 - float(structural_similarity(first, second))
    assert float(found) == pytest.approx(expected)
