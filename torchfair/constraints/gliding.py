"""Boundary vertices glide along the boundary curve."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry.closest_curve_point import ReferenceCurves
from ..projection import ElementTerm
from ..projection.layout import State


def offset_from_curve(x: Tensor, foot: Tensor, tangent: Tensor) -> Tensor:
    """Offset of the vertex ``x`` (1, 3) from the line through ``foot``; the part along ``tangent`` is free.

    A zero tangent (the foot is an end of the curve) leaves nothing free.
    """
    offset = x[0] - foot
    return offset - torch.dot(offset, tangent) * tangent


def gliding_terms(
    curves: ReferenceCurves, vertices: Tensor, curve_of_vertex: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Distance of boundary ``vertices`` (n,) from their own curves, in the unit of the vertices."""
    if not vertices.numel():
        return []

    def refresh(state: State) -> tuple[Tensor, Tensor]:
        points = state[block][vertices]
        closest = curves.closest(points, curve_of_vertex)
        slide = ((points - closest.positions) * closest.tangents).sum(1, keepdim=True)
        at_end = slide.abs() > 1e-9 * (1.0 + closest.distances[:, None])
        return closest.positions, torch.where(at_end, torch.zeros_like(closest.tangents), closest.tangents)

    stencil = [(block, vertices[:, None])]
    return [ElementTerm("boundary gliding", offset_from_curve, stencil, weight=weight, refresh=refresh)]
