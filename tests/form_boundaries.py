"""Boundary curves and surfaces between them."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from torchfair.curves import ClosedCurve

TURN = 2.0 * math.pi


def ring(radius: float, height: float) -> ClosedCurve:
    def function(t: Tensor) -> Tensor:
        return torch.stack([radius * torch.cos(TURN * t), radius * torch.sin(TURN * t), height + 0 * t], 1)

    return ClosedCurve.from_function(function)


def wave() -> ClosedCurve:
    return ClosedCurve.from_function(
        lambda t: torch.stack([torch.cos(TURN * t), torch.sin(TURN * t), 0.5 * torch.cos(2 * TURN * t)], 1)
    )


def cone_distance(vertices: Tensor, bottom: float, top: float, height: float) -> float:
    z = vertices[:, 2] - vertices[:, 2].min()
    exact = bottom + (top - bottom) * z / height
    slant = math.hypot(height, bottom - top) / height
    return float((vertices[:, :2].norm(dim=1) - exact).abs().max() / slant)
