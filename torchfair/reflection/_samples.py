"""From samples to pixels."""

from __future__ import annotations

import functools

import torch
from torch import Tensor

from ._shading import Shader

_BAND = 1 << 16  # samples coloured at a time on a CPU: keeps every temporary inside the cache


def mean_colors(shade: Shader, triangles: Tensor, factor: int) -> Tensor:
    """Mean colour of the samples of each pixel: (pictures H W, channels + 1).

    Args:
        shade: gives colours.
        triangles: (pictures, factor H, factor W) triangle at each sample, -1 for none.
        factor: samples along each side of a pixel.
    """
    height, width = triangles.shape[1:]
    rows = triangles.reshape(-1, factor * width)  # those of one row of pixels, through all pictures
    step = max(1, _BAND // rows.shape[1]) if triangles.device.type == "cpu" else max(1, rows.shape[0])
    bands = []
    for first in range(0, max(1, rows.shape[0]), step):
        band = rows[first : first + step]
        places = _centres(first * factor, band.shape[0] * factor, height, width, band) if shade.uses_places else band
        colors = shade(band.reshape(-1), places)
        if factor > 1:
            cells = colors.view(band.shape[0], factor, width // factor, factor, colors.shape[1])
            squares = (cells[:, i, :, j] for i in range(factor) for j in range(factor))
            colors = (functools.reduce(torch.add, squares) / factor**2).view(-1, colors.shape[1])
        bands.append(colors)
    return torch.cat(bands)


def coarse_pixels(samples: Tensor, width: int, factor: int) -> Tensor:
    """Numbers of the pixels that samples (S,), numbered row by row through pictures ``width`` samples wide, lie in."""
    if factor == 1:
        return samples
    row = torch.div(samples, width * factor, rounding_mode="floor")
    column = torch.div(torch.remainder(samples, width), factor, rounding_mode="floor")
    return row * (width // factor) + column


def _centres(first: int, count: int, height: int, width: int, like: Tensor) -> Tensor:
    """Centres (count * width, 2) of the squares of some rows of a stack of pictures, float64."""
    x = torch.arange(width, dtype=torch.float64, device=like.device) + 0.5
    y = torch.remainder(torch.arange(first, first + count, dtype=torch.float64, device=like.device), height) + 0.5
    return torch.stack([x.expand(count, -1), y[:, None].expand(-1, width)], dim=-1).view(-1, 2)
