"""A handle of the design of a tube that is pulled, and what the design says then."""

from __future__ import annotations

from typing import Any

import numpy as np
from design_tools import Bench

from torchfair.design.states import DesignState

S = DesignState
HANDLE, OTHER, THIRD = 30, 18, 42


def pulled(bench: Bench, vertex: int = HANDLE, outwards: float = 0.1) -> list[float]:
    """A place outside the tube."""
    place = bench.vertices[vertex].copy()
    place[:2] *= 1.0 + outwards
    return [float(value) for value in place]


def drag(bench: Bench, vertex: int = HANDLE, outwards: float = 0.1) -> list[float]:
    """Pulls a handle in two moves and lets it go."""
    start, end = bench.vertices[vertex].copy(), np.array(pulled(bench, vertex, outwards))
    for share in (0.5, 1.0):
        place = (1.0 - share) * start + share * end
        bench.say(type="move", places=[[vertex, *map(float, place)]], count=int(2 * share))
    bench.say(type="release", id=1)
    assert not bench.errors
    return end.tolist()


def last(bench: Bench, kind: str) -> Any:
    return bench.messages(kind)[-1]
