"""Linear equations with the exact second derivatives of a merit, solved by its Gauss-Newton factor."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

Operator = Callable[[Tensor], Tensor]


class AdjointSolution(NamedTuple):
    """Solution of ``H x = b``.

    Attributes:
        values: (N,) x.
        remainder: What is left of b, relative, in the norm of the preconditioner.
        products: Products with H that were needed.
        lowest: The smallest ratio of ``p H p`` to ``p M p`` met on the way, M being what the preconditioner inverts: at
            most 0 where H is not positive.
    """

    values: Tensor
    remainder: float
    products: int
    lowest: float


def conjugate(hessian: Operator, precondition: Operator, right: Tensor, accuracy: float, most: int) -> AdjointSolution:
    """Preconditioned conjugate gradients; ends at the first direction along which H is not positive.

    The update is that for preconditioners that change a little (Polak and Ribiere), such as inexact solvers.
    """
    values, rest = torch.zeros_like(right), right.clone()
    solved = precondition(rest)
    direction, square = solved.clone(), torch.dot(rest, solved)
    first, lowest, products = float(square), float("inf"), 0
    while products < most and float(square) > accuracy**2 * first:
        curved = hessian(direction)
        products += 1
        bend, stiffness = torch.dot(direction, curved), torch.dot(direction, rest)
        # Directions are conjugate: the preconditioned residual measures them well enough.
        lowest = min(lowest, float(bend / stiffness) if float(stiffness) > 0.0 else float("inf"))
        if not bool(bend > 0.0):
            return AdjointSolution(values, _relative(square, first), products, min(lowest, 0.0))
        length = stiffness / bend
        values, before = values + length * direction, rest
        rest = rest - length * curved
        solved = precondition(rest)
        ahead = torch.dot(rest - before, solved) / square
        square = torch.dot(rest, solved)
        direction = solved + ahead.clamp_min(0.0) * direction
    return AdjointSolution(values, _relative(square, first), products, lowest)


def stationary(hessian: Operator, precondition: Operator, right: Tensor, steps: int) -> AdjointSolution:
    """``steps`` rounds of ``x += M^-1 (b - H x)``: what backpropagation through as many Gauss-Newton steps gives."""
    values, first = torch.zeros_like(right), 0.0
    square = torch.zeros(())
    for number in range(steps):
        rest = right - hessian(values) if number else right
        solved = precondition(rest)
        square = torch.dot(rest, solved)
        first = first or float(square)
        values = values + solved
    return AdjointSolution(values, _relative(square, first), max(steps - 1, 0), float("inf"))


def _relative(square: Tensor, first: float) -> float:
    return (max(float(square), 0.0) / first) ** 0.5 if first > 0.0 else 0.0
