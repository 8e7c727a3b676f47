"""Sides of a plane on which the edges of a star lie: +1 above, -1 below, in cyclic order."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor


class Patterns(NamedTuple):
    """All ways in which a plane can meet ``k`` sectors in four segments.

    Attributes:
        signs: (P, k) sides of the edges, +1 or -1.
        crossed: (P, 4) the sectors that the plane meets; sector ``i`` lies between edges ``i`` and ``i + 1``.
    """

    signs: Tensor
    crossed: Tensor


@functools.cache
def four_run_patterns(valence: int) -> Patterns:
    """The ``2 (k choose 4)`` cyclic patterns of four runs, on the CPU."""
    signs, crossed = [], []
    for chosen in itertools.combinations(range(valence), 4):
        row = []
        side = 1
        for edge in range(valence):
            row.append(side)
            if edge in chosen:
                side = -side
        for flip in (1, -1):
            signs.append([flip * s for s in row])
            crossed.append(list(chosen))
    return Patterns(torch.tensor(signs).view(-1, valence), torch.tensor(crossed).view(-1, 4))


def crossed_sectors(signs: Tensor) -> Tensor:
    """(n, 4) sectors in which ``signs`` (n, k) of four runs change."""
    changes = (signs != signs.roll(-1, 1)).to(torch.int8)
    chosen: Tensor = changes.argsort(dim=1, descending=True, stable=True)[:, :4]
    return chosen


def count_changes(signs: Tensor) -> Tensor:
    """(...,) how often cyclic ``signs`` (..., k) change; zeros count as neither."""
    filled = fill_zeros(signs)
    changes: Tensor = (filled != filled.roll(-1, -1)).sum(-1)
    return changes


def fill_zeros(signs: Tensor, shift: int = 1) -> Tensor:
    """Zeros replaced by the sign before (``shift=1``) or after (``shift=-1``) them; all zero stays so."""
    for _ in range(signs.shape[-1] - 1):
        signs = torch.where(signs == 0, signs.roll(shift, -1), signs)
    return signs


def uneven(crossed: Tensor, valence: int) -> Tensor:
    """(n,) how far four runs are from those of a smooth saddle, the smaller the better.

    The asymptotic lines of a smooth saddle cut opposite sectors of equal size, so first comes the difference
    of opposite runs, then the length of the longest: 1,2,1,2 before 2,2,1,1 before 3,1,1,1.
    """
    runs = (crossed.roll(-1, 1) - crossed) % valence
    a, b, c, d = runs.unbind(1)
    unequal: Tensor = ((a - c).abs() + (b - d).abs()) * (valence + 1) + runs.amax(1)
    return unequal


def run_lengths(signs: Sequence[int]) -> tuple[int, ...]:
    """Lengths of the runs of equal sides around a star, in a normal form; zeros belong to no run.

    The starting point, the sense of rotation and the sides do not matter. Patterns that repeat after half a
    turn start with their shortest run, all others with their longest: 1,2,1,2 but 2,2,1,1 and 3,1,1,1, as the
    paper writes them. A single run is ``(k,)``.
    """
    kept = [sign for sign in signs if sign]
    starts = [i for i in range(len(kept)) if kept[i] != kept[i - 1]]
    if not starts:
        return (len(kept),) if kept else ()
    lengths = [(b - a) % len(kept) for a, b in zip(starts, starts[1:] + starts[:1], strict=True)]
    turns = [tuple(row[i:] + row[:i]) for row in (lengths, lengths[::-1]) for i in range(len(row))]
    half = len(lengths) // 2
    return min(turns) if lengths[:half] == lengths[half:] else max(turns)
