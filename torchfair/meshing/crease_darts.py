"""Creases as curves of the graph that the lines make on a surface."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from ..fields.frames import FaceFrames, Ints
from .chords import BrokenLinesError
from .crease_runs import CreaseLines
from .creases import SharpChain
from .crossings import Crossings

CUTS = 3
"""In place of the constant coordinate, on creases that are no lines."""


class CreaseDarts(NamedTuple):
    """Darts along creases, forward and backward ones in turn.

    Attributes:
        origin: (D,) node where a dart starts.
        edge: (D,) that it runs along at first.
        along: (D,) bool: whether it runs the way of the edge.
        coordinate: (D,) which one is constant, 3 where none is.
    """

    origin: Ints
    edge: Ints
    along: np.ndarray
    coordinate: Ints


def crease_darts(frames: FaceFrames, lines: CreaseLines, crossings: Crossings, name: Ints) -> CreaseDarts:
    """Creases between the nodes on them.

    Args:
        frames: of the triangles.
        lines: the creases.
        crossings: of lines with edges.
        name: (V,) nodes at vertices, -1 where there is none.

    Raises:
        BrokenLinesError: if a crease has too few nodes.
    """
    darts: list[tuple[int, int, bool, int]] = []
    for number, chain in enumerate(lines.creases.chains):
        stops = _stops(frames, chain, crossings, name)
        if len({node for node, _, _ in stops}) < (3 if chain.vertices[0] == chain.vertices[-1] else 2):
            raise BrokenLinesError("a crease is too short for edges of this length")
        coordinate = lines.coordinate(number, CUTS)
        forward = chain.forward(frames)
        for (first, _, leaves), (second, arrives, _) in itertools.pairwise(stops):
            darts.append((first, int(chain.edges[leaves]), bool(forward[leaves]), coordinate))
            darts.append((second, int(chain.edges[arrives]), not forward[arrives], coordinate))
    origin, edge, along, coordinates = np.array(darts, np.int64).reshape(-1, 4).T
    return CreaseDarts(origin, edge, along.astype(bool), coordinates)


def _stops(frames: FaceFrames, chain: SharpChain, crossings: Crossings, name: Ints) -> list[tuple[int, int, int]]:
    """Nodes along a chain with the places in it of the edges before and after; of a loop the first again at its end."""
    stops: list[tuple[int, int, int]] = []
    last = len(chain.edges) - 1
    for place, (edge, forward) in enumerate(zip(chain.edges.tolist(), chain.forward(frames).tolist(), strict=True)):
        if name[chain.vertices[place]] >= 0:
            before = place - 1 if place else last  # of an open chain nothing comes before
            stops.append((int(name[chain.vertices[place]]), before, place))
        here = range(crossings.offsets[edge], crossings.offsets[edge + 1])
        stops += [(node, place, place) for node in (here if forward else reversed(here))]
    if chain.closed:
        return [*stops, *stops[:1]]
    return [*stops, (int(name[chain.vertices[-1]]), last, last)]
