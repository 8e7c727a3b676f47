"""Curves for the tests of splines, and slow closest points on them."""

from __future__ import annotations

import math

import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.geometry import SplineCurves


def circle(angles: Tensor, radius: float = 1.0) -> Tensor:
    """Points (n, 3) of a circle about the z axis."""
    return radius * torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], 1)


def helix(angles: Tensor) -> Tensor:
    """Points (n, 3) of a helix with curvature and torsion 1/2."""
    return torch.stack([angles.cos(), angles.sin(), angles], 1)


def flower(count: int, petals: int = 5, depth: float = 0.3) -> Tensor:
    """Points (count, 3) of a smooth closed space curve."""
    t = 2.0 * math.pi * torch.arange(count, dtype=DOUBLE) / count
    radius = 1.0 + depth * torch.sin(petals * t)
    return torch.stack([radius * t.cos(), radius * t.sin(), 0.2 * torch.sin(3 * t)], 1)


def spiral(count: int, turns: float = 8.0) -> Tensor:
    """Points (count, 3) of a flat spiral whose turns lie side by side."""
    t = torch.linspace(0.0, 1.0, count, dtype=DOUBLE) ** 0.6
    return circle(2.0 * math.pi * turns * t) * (0.1 + t)[:, None]


def uneven(count: int, ratio: float, seed: int = 0) -> Tensor:
    """(count + 1,) from 0 to 1 in random steps, the longest up to ``ratio`` times as long as the shortest."""
    generator = torch.Generator().manual_seed(seed)
    steps = ratio ** torch.rand(count, dtype=DOUBLE, generator=generator)
    return torch.cat([steps.new_zeros(1), steps.cumsum(0)]) / steps.sum()


def everywhere(points: Tensor, closed: bool, per_segment: int = 32) -> Tensor:
    """Places (segments, per_segment + 1, 3) of the spline through ``points``, ends of segments included."""
    segments = len(points) - (not closed)
    number = torch.arange(segments).repeat_interleave(per_segment + 1)
    fraction = torch.linspace(0.0, 1.0, per_segment + 1, dtype=DOUBLE).repeat(segments)
    places = SplineCurves([points], [closed]).at(torch.zeros_like(number), number, fraction)
    return places.view(segments, per_segment + 1, 3)


def sampled_distances(points: Tensor, curve: Tensor, closed: bool) -> Tensor:
    """(N,) distances of points from dense samples of the spline through ``curve``: never less than from the spline."""
    samples = everywhere(curve, closed).reshape(-1, 3)
    return torch.cdist(points, samples, compute_mode="donot_use_mm_for_euclid_dist").amin(1)


def deviations(points: Tensor, closed: bool) -> Tensor:
    """(segments,) largest distance of each segment of a spline from its chord, as a fraction of the chord."""
    places = everywhere(points, closed)
    chord = places[:, -1:] - places[:, :1]
    offset = places - places[:, :1]
    along = ((offset * chord).sum(-1) / (chord * chord).sum(-1)).clamp(0.0, 1.0)
    away = (offset - along[..., None] * chord).norm(dim=-1).amax(1)
    return away / chord.norm(dim=-1)[:, 0]
