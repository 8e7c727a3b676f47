"""Numbers of edges in order."""

from __future__ import annotations

import numpy as np
import torch

from ._names import Ints
from ._tables import outside_of_transforms

_RADIX = 32768  # as many numbers as torch sorts by their digits
WORD = 64  # bits


def edge_keys(tails: Ints, heads: Ints, count: int) -> Ints:
    """One number for each edge among ``count`` vertices, whichever way it is traversed."""
    keys: Ints = np.minimum(tails, heads) * np.int64(max(count, 1)) + np.maximum(tails, heads)
    return keys


def groups_of(keys: Ints) -> tuple[Ints, Ints, Ints]:
    """Equal keys as ``(order, starts, counts)``: group i is ``order[starts[i] : starts[i] + counts[i]]``."""
    order, ordered = sort_keys(keys)
    starts = np.flatnonzero(np.diff(ordered, prepend=-1))
    return order, starts, np.diff(np.append(starts, keys.size))


def sort_keys(keys: Ints) -> tuple[Ints, Ints]:
    """The stable order of numbers that are at least 0, and the numbers in that order.

    Where a number and its place fit into one word, words are sorted, without an order beside them: 5 times as fast.
    """
    shift = max(keys.size - 1, 0).bit_length()
    if int(keys.max(initial=0)).bit_length() + shift <= WORD:
        words = np.left_shift(keys, shift, dtype=np.uint64, casting="unsafe")
        words |= np.arange(keys.size, dtype=np.uint64)
        words.sort()
        order = (words & np.uint64((1 << shift) - 1)).view(np.int64)
        words >>= np.uint64(shift)
        return order, words.view(np.int64)
    if keys.size < _RADIX:
        order = np.argsort(keys, kind="stable")
        return order, keys[order]
    with outside_of_transforms():  # torch sorts many integers digit by digit, three times as fast
        ordered, places = torch.sort(torch.from_numpy(keys), stable=True)
        return places.numpy(), ordered.numpy()
