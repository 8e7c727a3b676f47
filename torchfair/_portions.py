"""Ranges of elements that are worked on one after the other: temporaries are small and stay in the cache."""

from __future__ import annotations

import torch
from torch import Tensor

PORTION = 16384  # elements for each thread


def portions_unless(recorded: bool, count: int, like: Tensor, portion: int = PORTION) -> list[slice]:
    """Ranges of ``count`` elements; all of them at once while anything is recorded, and on other devices than CPUs."""
    if torch.compiler.is_compiling() or recorded or not like.is_cpu:
        return [slice(None)]
    size = portion * torch.get_num_threads()
    if count <= 2 * size:
        return [slice(None)]
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
