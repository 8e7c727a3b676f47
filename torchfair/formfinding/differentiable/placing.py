"""Vertices that glide, put on their curves: with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function
from torch.autograd.function import once_differentiable

_STEP = 1e-6  # of the extent: of a central difference


def placed(place: Callable[[Tensor], Tensor], vertices: Tensor) -> Tensor:
    """``place(vertices)`` (V, 3), where every vertex stays or goes to the closest point of some curve.

    The derivative of a closest point is symmetric (it is the gradient of half the square of the vertex less half the
    squared distance) and that of one vertex alone: so one central difference along the cotangents is all there is.
    """
    result: Tensor = _Placed.apply(vertices, place)  # type: ignore[no-untyped-call]
    return result


class _Placed(Function):
    """``(vertices, place) -> place(vertices)``."""

    @staticmethod
    def forward(ctx: Any, vertices: Tensor, place: Callable[[Tensor], Tensor]) -> Tensor:
        ctx.save_for_backward(vertices)
        ctx.place = place
        return place(vertices.detach()).clone()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, cotangent: Tensor) -> tuple[Tensor, None]:
        (vertices,) = ctx.saved_tensors
        largest = cotangent.abs().amax()
        if not bool(largest > 0.0):
            return torch.zeros_like(cotangent), None
        extent = (vertices.amax(0) - vertices.amin(0)).amax()
        step = _STEP * extent / largest
        ahead, behind = (ctx.place(vertices + sign * step * cotangent) for sign in (1.0, -1.0))
        return (ahead - behind) / (2.0 * step), None
