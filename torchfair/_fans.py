"""How the faces around vertices follow each other: fans and rings, by half-edges (see ``_half_edges``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ._half_edges import HalfEdges, Ints
from ._names import PlacedError, few

Links = npt.NDArray[np.signedinteger[Any]]  # numbers of half-edges, of 32 or 64 bits

_BLOCK = 1 << 16  # corners that are looked at together: few enough for the cache
_MOST_LINKS = 2**31 - 1  # that integers of 32 bits number: half of the memory to look things up in
_MOST_STEPS = 16  # faces around a vertex, as there are few with more


@dataclass(frozen=True)
class Fans:
    """How the faces around each vertex follow each other.

    Attributes:
        degree: (V,) number of faces.
        start: (V,) half-edge of each vertex to begin with, -1 at isolated ones: the boundary edge that has the surface
            on its left, or around others the edge of the first face that uses the vertex.
        around: (H,) next outgoing half-edge, counterclockwise; -1 at the end of an open fan.
    """

    degree: Ints
    start: Links
    around: Links


def _fans(half: HalfEdges, twins: Ints, links: type[np.signedinteger[Any]] = np.int64) -> Fans:
    """Those of a mesh, with ``start`` and ``around`` of the integers ``links``."""
    start = np.full(half.num_vertices, -1, links)
    for begin in range((half.corners.size - 1) // _BLOCK * _BLOCK, -1, -_BLOCK):  # the first face comes last, and stays
        tails = half.corners[begin : begin + _BLOCK]
        start[tails[::-1]] = np.arange(begin + tails.size - 1, begin - 1, -1)
    is_open = np.flatnonzero(twins < 0)
    start[half.corners[is_open]] = is_open
    degree = np.bincount(half.corners, minlength=half.num_vertices)
    return Fans(degree, start, half.of_previous(twins, links))


def check_fans(half: HalfEdges, twins: Ints) -> None:
    """Refuses vertices whose faces form more than one fan.

    It goes around all vertices at once, face by face; vertices of many faces are left to :func:`build_rings`.
    """
    fans = _fans(half, twins, np.int32 if twins.size <= _MOST_LINKS else np.int64)
    steps = min(int(fans.degree.max(initial=0)), _MOST_STEPS)
    split: list[list[Ints]] = [[] for _ in range(steps)]
    is_long = False
    for begin in range(0, half.num_vertices, _BLOCK):
        first = fans.start[begin : begin + _BLOCK]
        vertices = np.flatnonzero(first >= 0)
        degree = fans.degree[begin : begin + _BLOCK][vertices]
        first = at = first[vertices]
        for passed in range(1, steps + 1):
            at = fans.around[at]
            going = (at >= 0) & (at != first)
            split[passed - 1].append(vertices[~going & (degree != passed)] + begin)
            vertices, degree, first, at = vertices[going], degree[going], first[going], at[going]
        is_long |= vertices.size > 0
    for found in split:
        _refuse_fans(np.concatenate(found))
    if is_long:
        build_rings(half, twins)


def _refuse_fans(split: Ints) -> None:
    if split.size:
        raise PlacedError(
            f"non-manifold: the faces around {split.size} vertex(es) form more than one fan: vertices ",
            few("vertex", split),
            ". Duplicate such a vertex, one copy per fan, as torchfair.repair_mesh does.",
        )


def build_rings(half: HalfEdges, twins: Ints) -> tuple[Ints, Ints]:
    """Neighbours of every vertex in counterclockwise order, packed as ``(ring_vertices, ring_offsets)``.

    Around boundary vertices the ring starts with the boundary edge that has the surface on its left; around
    others with the edge of the first face that uses the vertex. Refuses vertices whose faces form more than
    one fan.
    """
    fans = _fans(half, twins)
    tails, start, degree, around = half.corners, fans.start, fans.degree, fans.around
    ends = around < 0
    remaining = _steps_to_end(np.where(around == start[tails], -1, around), int(degree.max(initial=0)))
    used = np.flatnonzero(start >= 0)
    _refuse_fans(used[remaining[start[used]] + 1 != degree[used]])  # the chain from the start misses some faces
    has_boundary = np.bincount(tails[twins < 0], minlength=half.num_vertices)
    offsets = np.concatenate([[0], np.cumsum(degree + has_boundary)])
    ring = np.empty(offsets[-1], np.int64)
    ring[offsets[tails] + degree[tails] - 1 - remaining] = half.heads
    ring[offsets[tails[ends] + 1] - 1] = tails[half.previous[ends]]
    return ring, offsets


def _steps_to_end(following: Ints, longest: int) -> Ints:
    """Steps from every link to the end of its chain of at most ``longest`` links; ``following`` is -1 at ends.

    Pointer doubling: each round doubles the distance looked ahead, so that one vertex of huge valence costs
    no more than a million ordinary ones. Links on closed chains get a meaningless number.
    """
    sentinel = following.size
    ahead = np.append(np.where(following < 0, sentinel, following), sentinel)
    steps: Ints = (ahead != sentinel).astype(np.int64)
    for _ in range(longest.bit_length()):
        steps += steps[ahead]
        ahead = ahead[ahead]
    return steps[:-1]
