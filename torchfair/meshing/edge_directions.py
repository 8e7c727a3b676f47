"""Directions that edges of polygons had before nodes were moved onto others."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..fields.frames import Floats


class EdgeDirections:
    """First directions of edges, kept as their ends are collapsed to other nodes.

    Args:
        positions: (N, 3) of nodes.
    """

    def __init__(self, positions: Floats) -> None:
        self.positions = positions
        self._first: dict[tuple[int, int], Floats] = {}

    def turn(self, node: int, end: int, other: int) -> float:
        """Angle between the first direction of the edge from a node to its end and the way to another, radians."""
        first, ahead = self._from(node, end), self.positions[other] - self.positions[node]
        return math.atan2(float(np.linalg.norm(np.cross(first, ahead))), float(first @ ahead))

    def carry(self, nodes: Iterable[int], end: int, other: int) -> None:
        """Edges from nodes to an end lead to another node from now on."""
        for node in nodes:
            self._first[node, other] = self._from(node, end)
            self._first[other, node] = -self._first[node, other]

    def _from(self, node: int, end: int) -> Floats:
        first = self._first.get((node, end))
        return self.positions[end] - self.positions[node] if first is None else first
