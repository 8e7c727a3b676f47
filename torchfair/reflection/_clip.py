"""Cuts away what lies at or behind the eye."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Clipped(NamedTuple):
    """What is left of triangles or edges.

    Attributes:
        items: (n, 3) or (n, 2) points.
        source: (n,) the triangle or edge each was part of.
        blends: (Q, 2) the two points that each new point lies between; new points are numbered after the old ones.
        weights: (Q,) share of the second of them.
    """

    items: Tensor
    source: Tensor
    blends: Tensor
    weights: Tensor


def clip_triangles(triangles: Tensor, distance: Tensor, num_points: int) -> Clipped:
    """The parts of ``triangles`` (T, 3) where ``distance`` (P,), affine in between, is positive.

    New points get the numbers from ``num_points``. Neighbours compute their common new points from the same two
    ends in the same order, so that no gap opens.
    """
    inside = distance[triangles] > 0
    count = inside.sum(1)
    whole = torch.nonzero(count == 3).squeeze(1)
    tip = torch.nonzero(count == 1).squeeze(1)  # one corner is left: a triangle
    stump = torch.nonzero(count == 2).squeeze(1)  # one corner is lost: a quad, cut in two
    a, b, c = _turned(triangles[tip], inside[tip].to(torch.int64).argmax(1)).unbind(1)
    o, p, q = _turned(triangles[stump], inside[stump].to(torch.int64).argmin(1)).unbind(1)
    blends = torch.cat([torch.stack(pair, dim=1) for pair in ((a, b), (a, c), (p, o), (q, o))])
    new = torch.arange(num_points, num_points + blends.shape[0], device=triangles.device)
    ab, ac, po, qo = torch.split(new, [len(tip), len(tip), len(stump), len(stump)])
    parts = [torch.stack(corners, dim=1) for corners in ((a, ab, ac), (p, q, qo), (p, qo, po))]
    source = torch.cat([whole, tip, stump, stump])
    return Clipped(torch.cat([triangles[whole], *parts]), source, blends, _weights(distance, blends))


def clip_edges(edges: Tensor, distance: Tensor, num_points: int) -> Clipped:
    """The parts of ``edges`` (E, 2) where ``distance`` (P,) is positive; new points from ``num_points`` on."""
    inside = distance[edges] > 0
    count = inside.sum(1)
    whole = torch.nonzero(count == 2).squeeze(1)
    cut = torch.nonzero(count == 1).squeeze(1)
    blends = torch.where(inside[cut, :1], edges[cut], edges[cut].flip(1))
    new = torch.arange(num_points, num_points + blends.shape[0], device=edges.device)
    items = torch.cat([edges[whole], torch.stack([blends[:, 0], new], dim=1)])
    return Clipped(items, torch.cat([whole, cut]), blends, _weights(distance, blends))


def _turned(triangles: Tensor, first: Tensor) -> Tensor:
    """Triangles with the same orientation that start at corner ``first``."""
    order = (first[:, None] + torch.arange(3, device=first.device)) % 3
    return triangles.gather(1, order)


def _weights(distance: Tensor, blends: Tensor) -> Tensor:
    """Where between an inner and an outer point the distance is zero."""
    inner, outer = distance[blends].unbind(1)
    return inner / (inner - outer)
