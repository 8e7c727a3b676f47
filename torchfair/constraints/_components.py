"""Vectors of many elements with components first and elements last: operations on long rows are several times faster.

Everything here works for one element as well, without the last dimension.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor


def components_first(x: Tensor) -> Tensor:
    """(3, k, n) from the unknowns (n, k, 3) of elements; (3, k) from those of one."""
    return x.transpose(0, -1).contiguous()


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Scalar products along the first dimension."""
    return (a * b).sum(0)


def lengths(vectors: Tensor) -> Tensor:
    """Lengths along the first dimension, zero with derivative zero where vectors are; faster than ``vector_norm``."""
    squared = dot(vectors, vectors)
    positive = ~(squared <= 0.0)
    return torch.where(positive, torch.where(positive, squared, 1.0).sqrt(), 0.0)


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Cross products along the first dimension, faster there than ``torch.linalg.cross``."""
    a, b = torch.cat([a, a[:2]]), torch.cat([b, b[:2]])
    return a[1:4] * b[2:5] - a[2:5] * b[1:4]


def derivative_rows(by_corners: Sequence[Tensor]) -> Tensor:
    """(n, 3k) the derivative of a scalar residual from those by its k corners, (3, n) each."""
    return torch.cat(list(by_corners)).transpose(0, -1)


def area_vectors(polygon: Tensor) -> Tensor:
    """(3, n) area vectors of polygons (3, k, n), counterclockwise."""
    spokes = polygon[:, 1:] - polygon[:, :1]
    if polygon.shape[1] == 3:
        return 0.5 * cross(spokes[:, 0], spokes[:, 1])
    return 0.5 * cross(spokes[:, :-1], spokes[:, 1:]).sum(1)


def area_derivatives(polygon: Tensor, direction: Tensor) -> Tensor:
    """(3, k, n) derivatives of ``g . A`` by the corners, A the area vectors and g a ``direction`` (3, n).

    The area vector is ``sum x_i x x_(i+1) / 2``, so that x_i turns it with half the chord between its neighbours.
    """
    chords = polygon.roll(-1, 1) - polygon.roll(1, 1)
    return 0.5 * cross(chords, direction[:, None].expand_as(chords))
