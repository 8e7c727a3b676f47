"""Descent to a minimum with exact second derivatives, from where Gauss-Newton steps have become slow."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from .adjoint import Operator
from .layout import State
from .merit_derivatives import MeritDerivatives
from .problem import Problem
from .stationary_point import Preconditioner
from .trials import Guard

_FIRST = 4.0  # radius, over the length of a Gauss-Newton step
_PRODUCTS = 100  # in one step
_ROUGHLY = 0.3  # accuracy of steps far from the minimum
_GOOD, _POOR = 0.75, 0.25  # actual over predicted fall: the region grows above, shrinks below
_LARGER, _SMALLER = 2.5, 0.25
_LEAST_GAIN = 1e-4
_ROUNDING = 1e-13  # of the merit: a fall that cannot be told from rounding
_LEAST_RADIUS = 1e-10  # of the first one


class Descent(NamedTuple):
    """Where trust-region steps ended.

    Attributes:
        blocks: There.
        steps: Taken or refused.
        products: Products with the exact second derivatives.
        arrived: Whether the next step is short enough, or promises less than can be computed.
        refused: Whether the last step was refused by the guard.
    """

    blocks: dict[str, Tensor]
    steps: int
    products: int
    arrived: bool
    refused: bool


class _Step(NamedTuple):
    change: Tensor
    predicted: float
    products: int
    at_edge: bool


def descended(
    problem: Problem, blocks: State, *, guard: Guard | None = None, tolerance: float = 1e-7, most: int = 100
) -> Descent:
    """Trust-region steps by preconditioned conjugate gradients (Steihaug 1983), until one is short.

    The model has the exact second derivatives of the merit. Along directions in which these are not positive a step
    goes to the edge of the region, so that saddle points are left. The norm is that of the Gauss-Newton matrix, which
    has no units. The merit falls in every step that is taken, and the guard admits it.

    Args:
        problem: With its terms.
        blocks: Start.
        guard: ``guard(state, trial)`` refuses a trial.
        tolerance: Length of the last step, relative to the extent of the blocks.
        most: Steps, refused ones included.
    """
    layout, free = problem.layout, problem.structure.free
    state, merit, products, radius, refused = dict(blocks), _merit(problem, blocks), 0, 0.0, False
    local, first = None, 0.0
    for number in range(most):
        if local is None:
            local = MeritDerivatives(layout, problem.terms, state, free)
            gradient, precondition = local.gradient.detach() * free, Preconditioner(problem, state)
            size = math.sqrt(max(float(torch.dot(gradient, precondition(gradient))), 0.0))
        if not number:
            radius = first = _FIRST * size
        accuracy = min(_ROUGHLY, math.sqrt(size / math.sqrt(merit))) if merit > 0.0 else _ROUGHLY
        step = _steihaug(local.free_product, precondition, gradient, radius, accuracy)
        products += step.products
        promises_nothing = -step.predicted <= torch.finfo(gradient.dtype).eps * abs(merit)
        if not step.at_edge and (promises_nothing or local.relative_length(step.change) <= tolerance):
            return Descent(state, number, products, True, False)
        trial = layout.unflatten(layout.flatten(state) + step.change)
        there = _merit(problem, trial)
        refused = math.isfinite(there) and guard is not None and not guard(state, trial)
        gain = _gain(merit, there, step) if not refused else -1.0
        if gain < _POOR:
            radius *= _SMALLER
        elif gain > _GOOD and step.at_edge:
            radius *= _LARGER
        if gain > _LEAST_GAIN:
            state, merit, local = trial, there, None
        if radius <= _LEAST_RADIUS * first:
            return Descent(state, number + 1, products, False, refused)
    return Descent(state, most, products, False, refused)


def _merit(problem: Problem, state: State) -> float:
    with torch.no_grad():
        return float(problem.structure.evaluate(state).merits[0])


def _gain(before: float, after: float, step: _Step) -> float:
    """Actual over predicted fall; 1 where that is too small to be computed."""
    if not math.isfinite(after):
        return -1.0
    if -step.predicted <= _ROUNDING * abs(before):
        return 1.0
    return (after - before) / step.predicted if step.predicted < 0.0 else -1.0


def _steihaug(hessian: Operator, precondition: Operator, gradient: Tensor, radius: float, accuracy: float) -> _Step:
    """Least ``g s + s H s / 2`` along the way of conjugate gradients, with ``|s|`` at most the radius.

    Lengths and products of step and direction in the norm of the preconditioner follow from recurrences.
    """
    step, curved = torch.zeros_like(gradient), torch.zeros_like(gradient)
    rest, solved = gradient, precondition(gradient)
    direction, square = -solved, float(torch.dot(gradient, solved))
    first, own, mixed, long, count = square, 0.0, 0.0, square, 0
    while count < _PRODUCTS and square > accuracy**2 * first:
        bent = hessian(direction)
        count += 1
        curvature = float(torch.dot(direction, bent))
        length = square / curvature if curvature > 0.0 else math.inf
        if not own + 2.0 * length * mixed + length * length * long < radius * radius:
            length = (-mixed + math.sqrt(max(mixed * mixed + long * (radius * radius - own), 0.0))) / long
            step, curved = step + length * direction, curved + length * bent
            return _Step(step, float(torch.dot(gradient, step) + 0.5 * torch.dot(step, curved)), count, True)
        step, curved, rest = step + length * direction, curved + length * bent, rest + length * bent
        own += 2.0 * length * mixed + length * length * long
        solved = precondition(rest)
        before, square = square, float(torch.dot(rest, solved))
        ahead = square / before
        mixed, long = ahead * (mixed + length * long), square + ahead * ahead * long
        direction = -solved + ahead * direction
    return _Step(step, float(torch.dot(gradient, step) + 0.5 * torch.dot(step, curved)), count, False)
