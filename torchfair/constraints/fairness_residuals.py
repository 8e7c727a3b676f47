"""Residuals of fairness at one vertex: umbrella vectors and second differences, and what they are held to."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import angle_of, cross, dot, norm, unit


def umbrella(x: Tensor) -> Tensor:
    """Mean of the neighbours ``x[1:]`` minus the vertex ``x[0]`` (Kobbelt et al. 1998)."""
    return x[1:].mean(0) - x[0]


def tangential_umbrella(x: Tensor) -> Tensor:
    """:func:`umbrella` without its part along the normal of the star."""
    vector, normal = umbrella(x), star_normal(x)
    return vector - dot(vector, normal) * normal


def star_normal(x: Tensor) -> Tensor:
    """Unit normal of a star ``x`` (1 + k, 3): that of its sectors, weighted by their angles; zero if it has none.

    The vertex normal of a triangle mesh, and of polygons that are planar around the vertex.
    """
    spokes = x[1:] - x[0]
    after = spokes.roll(-1, 0)
    sides = cross(spokes, after)
    sizes = norm(sides)
    weights = angle_of(sizes, dot(spokes, after)) / torch.where(sizes > 0, sizes, 1.0)
    return unit((weights[:, None] * sides).sum(0))


def second_difference(x: Tensor) -> Tensor:
    """Half the second difference ``(x[0] - 2 x[1] + x[2]) / 2``: an umbrella of two neighbours."""
    return 0.5 * (x[0] + x[2]) - x[1]


def umbrella_offset(x: Tensor, target: Tensor) -> Tensor:
    """:func:`umbrella` minus a given vector."""
    return umbrella(x) - target


def difference_offset(x: Tensor, target: Tensor) -> Tensor:
    """:func:`second_difference` minus a given vector."""
    return second_difference(x) - target
