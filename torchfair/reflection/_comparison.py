"""How two pictures differ inside the window that both show."""

from __future__ import annotations

import torch
from torch import Tensor

WINDOW = 11
"""Pixels along the square that the structural similarity (SSIM) of a pixel looks at."""


_COVERED = 1 - 1e-4  # coverage is a mean, rounded


def comparison_window(first: Tensor, second: Tensor) -> Tensor:
    """Mask (*batch, H, W) of the pixels whose whole SSIM square is covered in both pictures.

    Args:
        first: coverage (*batch, H, W), 0 to 1.
        second: coverage of the same shape, or one that broadcasts.
    """
    open_pixels = ((first < _COVERED) | (second < _COVERED)).to(first.dtype)
    radius = WINDOW // 2
    flat = open_pixels.reshape(-1, 1, *open_pixels.shape[-2:])
    padded = torch.nn.functional.pad(flat, [radius] * 4, value=1.0)
    return torch.nn.functional.max_pool2d(padded, WINDOW, stride=1).view(open_pixels.shape) == 0


def dissimilarity(image: Tensor, reference: Tensor, window: Tensor) -> Tensor:
    """Mean of ``1 - SSIM`` over the window, per channel: (*batch, channels), 0 where the window is empty.

    Args:
        image: (*batch, channels, H, W) in 0..1.
        reference: of the same shape, or one that broadcasts to it.
        window: (*batch, H, W) bool.
    """
    from kornia.metrics import ssim

    shape = image.shape
    if min(shape[-2:]) <= WINDOW:  # too small for kornia to pad, and for a window
        return image.new_zeros(shape[:-2])
    first, second = (picture.expand(shape).reshape(-1, *shape[-3:]) for picture in (image, reference))
    similarity = ssim(first, second, WINDOW, eps=0.0).view(shape)
    return masked_mean(1 - similarity, window[..., None, :, :])


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of ``values`` over the last two dimensions where ``mask`` holds, 0 where it never does."""
    weights = mask.to(values.dtype)
    total = torch.where(mask, values, 0.0).sum((-2, -1))
    return total / weights.sum((-2, -1)).clamp(min=1)


def blur(values: Tensor, mask: Tensor, sigma: Tensor) -> Tensor:
    """Gaussian means of ``values`` (*batch, channels, H, W) over the pixels of ``mask`` (*batch, H, W).

    ``sigma`` (*batch,) is in pixels. Outside of the mask the result is 0.
    """
    height, width = values.shape[-2:]
    down, across = _weights(sigma, height), _weights(sigma, width)
    weights = mask.to(values.dtype)
    total = down[..., None, :, :] @ (values * weights[..., None, :, :]) @ across[..., None, :, :]
    share = down @ weights @ across
    inside = mask & (share > 0)
    return torch.where(inside[..., None, :, :], total / torch.where(inside, share, 1.0)[..., None, :, :], 0.0)


def _weights(sigma: Tensor, size: int) -> Tensor:
    """Symmetric matrices (*batch, size, size) of Gaussian weights between pixels; the identity for sigma 0."""
    place = torch.arange(size, device=sigma.device, dtype=sigma.dtype)
    distance = (place[:, None] - place) / sigma.clamp(min=1e-3)[..., None, None]
    return torch.exp(-0.5 * distance**2)
