"""Depth and number of a triangle in one integer: the least of several is the nearest, of equals the first."""

from __future__ import annotations

import torch
from torch import Tensor

NO_KEY = torch.iinfo(torch.int64).max
"""Greater than every key."""


def key_bits(count: int) -> int:
    """Bits that the numbers of ``count`` triangles take; the other 62 are left to depth."""
    return max(1, count.bit_length())


def depth_levels(lower: Tensor, upper: Tensor, picture: Tensor, num_pictures: int, bits: int) -> tuple[Tensor, Tensor]:
    """Origin and scale (pictures,) that map depths between ``lower`` and ``upper`` (n,), float64, to levels."""
    return levels_within(*depth_range(lower, upper, picture, num_pictures), bits)


def depth_range(lower: Tensor, upper: Tensor, picture: Tensor, num_pictures: int) -> tuple[Tensor, Tensor]:
    """Least ``lower`` and greatest ``upper`` depth (pictures,) in each picture; of nothing inf and -inf."""
    low = lower.new_full((num_pictures,), torch.inf).scatter_reduce_(0, picture, lower, "amin")
    high = lower.new_full((num_pictures,), -torch.inf).scatter_reduce_(0, picture, upper, "amax")
    return low, high


def levels_within(low: Tensor, high: Tensor, bits: int) -> tuple[Tensor, Tensor]:
    """Origin and scale (pictures,) that map depths from ``low`` to ``high`` (pictures,) to levels."""
    extent = high - low
    return low, (1 << (62 - bits)) / torch.where(extent > 0, extent, 1)


def pack_keys(level: Tensor, number: Tensor, bits: int) -> Tensor:
    """Keys of triangles at depth levels."""
    return (level.to(torch.int64) << bits) | number


def unpack_keys(keys: Tensor, bits: int) -> Tensor:
    """Numbers of triangles in keys, -1 for :data:`NO_KEY`; overwrites ``keys``."""
    ones = (1 << bits) - 1
    numbers = keys.bitwise_and_(ones)  # in place: the buffer is large
    return numbers.masked_fill_(numbers == ones, -1)
