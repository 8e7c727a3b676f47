"""Whether the end of a solve is a minimum that depends differentiably on what it was made of, or can be made one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ..errors import SingularSystemError
from ..linear.base import Factor
from .adjoint import AdjointSolution, conjugate
from .layout import State
from .merit_derivatives import MeritDerivatives
from .problem import Problem
from .steps import init
from .term import ElementTerm

_SLIGHT = 1e-9  # damping of the preconditioner, relative to the largest stiffness
_ACCURACY = 1e-6  # of a Newton step


@dataclass(frozen=True)
class StationaryPoint:
    """The end of a solve, after Newton steps.

    Attributes:
        blocks: There.
        step: Length of the next Newton step relative to the extent of the blocks: the distance from the minimum.
        steps: Newton steps that were taken.
        products: Products with the exact second derivatives that they took.
        lowest: Least ratio of exact to Gauss-Newton curvature met.
        fault: Why derivatives mean nothing here, empty if they do.
    """

    blocks: dict[str, Tensor]
    step: float
    steps: int
    products: int
    lowest: float
    fault: str


class Preconditioner:
    """Inverse of the Gauss-Newton matrix of a problem at a state, slightly damped, factorised by its linear solver."""

    def __init__(self, problem: Problem, state: State) -> None:
        with torch.no_grad():
            begun = init(problem, state).linearised
            diagonal = begun.system.diagonal
            self._free = problem.structure.free
            slight = _SLIGHT * diagonal.amax().clamp_min(torch.finfo(diagonal.dtype).tiny)
            damping = torch.where(self._free & (diagonal > 0), slight, diagonal.amax().clamp_min(1e-30))
            problem.prepare()
            self._factor: Factor = problem.solver.factorise(begun.system, damping)

    def __call__(self, right: Tensor) -> Tensor:
        """Its inverse times a vector (N,); zero at fixed unknowns."""
        with torch.no_grad():
            return self._factor.solve(right * self._free, 1e-3).values * self._free


def polished(
    problem: Problem, terms: Sequence[ElementTerm], blocks: State, *, tolerance: float, most: int, products: int
) -> StationaryPoint:
    """Newton steps without damping from the end of a solve, until they are shorter than a tolerance.

    Args:
        problem: With these terms.
        terms: Of the problem.
        blocks: The end of the solve.
        tolerance: Length of a step, relative to the extent of the blocks.
        most: Steps.
        products: Products for each.
    """
    layout, free = problem.layout, problem.structure.free
    state, spent, lowest, step = dict(blocks), 0, float("inf"), float("inf")
    for taken in range(most + 1):
        merit = MeritDerivatives(layout, terms, state, free)
        right = -(merit.gradient.detach() * free)
        if not bool(torch.isfinite(right).all()):
            return StationaryPoint(state, step, taken, spent, lowest, "the gradient of the merit is not finite")
        if not bool((right != 0).any()):
            return StationaryPoint(state, 0.0, taken, spent, lowest, "")
        try:
            precondition = Preconditioner(problem, state)
            newton = conjugate(merit.free_product, precondition, right, _ACCURACY, products)
        except SingularSystemError as error:
            return StationaryPoint(state, step, taken, spent, lowest, f"the linear system is singular: {error}")
        spent, lowest = spent + newton.products, min(lowest, newton.lowest)
        if not newton.lowest > 0.0:
            return StationaryPoint(state, step, taken, spent, lowest, _bent(newton))
        step = merit.relative_length(newton.values)
        if step <= tolerance:
            return StationaryPoint(state, step, taken, spent, lowest, "")
        if taken < most:
            state = layout.unflatten(layout.flatten(state) + newton.values)
    fault = (
        f"the gradient is not small: after {most} Newton steps the next one is still {step:.1e} of the extent, above "
        f"{tolerance:.1e}; residuals have kinks here (smooth them), or the solve ended early (allow more iterations)"
    )
    return StationaryPoint(state, step, most, spent, lowest, fault)


def _bent(newton: AdjointSolution) -> str:
    return (
        f"the curvature of the merit is not positive along a direction ({newton.lowest:.1e} of that of the model): "
        "this is no minimum, or not the only one nearby (add a weak term that decides, such as closeness to the start)"
    )
