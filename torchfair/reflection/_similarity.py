"""Structural similarity of pictures (SSIM)."""

from __future__ import annotations

import torch
from torch import Tensor

WINDOW = 11
"""Pixels along the square that the structural similarity of a pixel looks at."""
_SIGMA = 1.5  # pixels, of the Gaussian weights in it
_MEANS, _VARIANCES = 0.01**2, 0.03**2  # for values from 0 to 1: they keep the quotients from 0 / 0


def structural_similarity(first: Tensor, second: Tensor) -> Tensor:
    """``(2 a b + c) (2 cov(x, y) + d) / ((a^2 + b^2 + c) (var x + var y + d))`` of the squares around pixels.

    With a and b the means of both squares x and y, in Gaussian weights; c and d are small. Symmetric, from -1 to 1, and
    1 where the squares are the same. Wang, Bovik, Sheikh and Simoncelli 2004, equation 13.

    Args:
        first: (*batch, H, W) values from 0 to 1.
        second: of the same shape.

    Returns:
        (*batch, H - 10, W - 10): of the pixels whose square is inside.
    """
    moments = torch.stack([first, second, first * first, second * second, first * second])
    a, b, squares, others, products = _weighted(moments).unbind(0)
    means = (2.0 * a * b + _MEANS) / (a * a + b * b + _MEANS)
    return means * (2.0 * (products - a * b) + _VARIANCES) / (squares - a * a + others - b * b + _VARIANCES)


def _weighted(values: Tensor) -> Tensor:
    """Gaussian means of all squares of (*batch, H, W): (*batch, H - 10, W - 10)."""
    height, width = values.shape[-2:]
    return _means(height, values) @ values @ _means(width, values).mT


def _means(size: int, values: Tensor) -> Tensor:
    """(size - 10, size) of weights: products of matrices are faster than convolutions of so many small pictures."""
    place = torch.arange(size, dtype=values.dtype, device=values.device)
    away = place - (place[: size - WINDOW + 1, None] + WINDOW // 2)
    weights = torch.where(away.abs() <= WINDOW // 2, torch.exp(-0.5 * (away / _SIGMA).square()), 0.0)
    return weights / weights.sum(1, keepdim=True)
