"""Runs of consecutive numbers, written out some at a time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import torch
from torch import Tensor


def expand_counts(counts: Tensor) -> tuple[Tensor, Tensor]:
    """Item number and position within the item, for every unit of ``counts``."""
    item = torch.repeat_interleave(counts)
    begin = counts.cumsum(0) - counts
    return item, torch.arange(item.shape[0], device=counts.device) - begin.index_select(0, item)


def run_chunks(begin: Tensor, length: Tensor, chunk: int = 1 << 15) -> Iterator[tuple[Tensor, Tensor]]:
    """Every number of the runs ``begin .. begin + length - 1`` once, in chunks ``(number of the run, number)``.

    On a CPU chunks hold about ``chunk`` numbers, so that temporaries stay inside the cache; elsewhere one holds all.
    """
    chosen = torch.nonzero(length).squeeze(1)
    begin, length = begin.index_select(0, chosen), length.index_select(0, chosen)
    ends = length.cumsum(0)
    total = int(ends[-1]) if ends.shape[0] else 0
    size = chunk if ends.device.type == "cpu" else max(total, 1)
    marks = torch.arange(size, max(total, size), size, device=ends.device)
    cuts = torch.searchsorted(ends, marks).tolist()
    for low, high in itertools.pairwise([0, *cuts, ends.shape[0]]):
        if high > low:
            item, offset = expand_counts(length[low:high])
            yield chosen[low:high].index_select(0, item), begin[low:high].index_select(0, item) + offset
