"""Weights of interior vertices: Loop's, Warren's, Catmull and Clark's, and those where triangles meet polygons."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..errors import TorchfairError
from ._arrays import Ints
from ._smooth import VertexWeights

LoopWeights = Literal["loop", "warren"]


def loop_weights(valences: Ints, kind: LoopWeights = "loop") -> VertexWeights:
    """``1 - n b`` of the vertex and b of each of its n neighbours; b = 1/16 for n = 6.

    Loop: ``b = (5/8 - (3/8 + cos(2 pi / n) / 4)^2) / n``. Warren: ``b = 3/(8 n)``, and 3/16 for n = 3.

    Raises:
        TorchfairError: for another kind of weights.
    """
    if kind not in get_args(LoopWeights):
        raise TorchfairError(f'weights: expected "loop" or "warren", got {kind!r}')
    n = np.maximum(valences, 1).astype(np.float64)
    if kind == "loop":
        ring = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4) ** 2) / n
    else:
        ring = np.where(n <= 3, 3 / 16, 3 / (8 * n))
    return VertexWeights(1 - n * ring, ring, np.zeros_like(ring))


def catmull_clark_weights(valences: Ints) -> VertexWeights:
    """``(n - 2)/n`` of the vertex, ``1/n^2`` of each of its n neighbours and of the centroids of its n faces.

    The same as ``(Q + 2 R + (n - 3) S) / n`` with the mean Q of the centroids, the mean R of the middles of the
    edges and the vertex S.
    """
    n = np.maximum(valences, 1).astype(np.float64)
    return VertexWeights((n - 2) / n, 1 / n**2, 1 / n**2)


def mixed_weights(valences: Ints, polygons: Ints) -> VertexWeights:
    """``a (1 + n/4)`` of the vertex, ``a/4`` of its n neighbours and of the centroids of its ``polygons`` q.

    ``1/a = 1 + n/2 + q/4``. These are the averages of Stam and Loop after linear splitting: a of the vertex, a/2 of
    the middles of its edges, a/4 of the middles of its polygons. They agree with Loop for n = 6, q = 0 and with
    Catmull and Clark for n = q = 4.
    """
    a = 1 / (1 + valences / 2 + polygons / 4)
    return VertexWeights(a * (1 + valences / 4), a / 4, a / 4)
