"""A damped step, before anyone knows whether it lowers the merit."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from ..linear import Factor
from .system import LinearSystem


@dataclass(frozen=True)
class Proposal:
    """A step to be tried.

    Attributes:
        change: (N,) zero at fixed unknowns.
        predicted: By how much the merit of the linearised residuals falls.
        iterations: Of the linear solver, over all systems solved.
        system, factor: The last system that was solved for the step, and its damped matrix.
        damping: (N,) its diagonal.
        heeded: Inequalities that the system takes for equations, if there are any.
    """

    change: Tensor
    predicted: float
    iterations: int
    system: LinearSystem
    factor: Factor
    damping: Tensor
    heeded: Tensor | None = None

    @classmethod
    def of(cls, system: LinearSystem, factor: Factor, damping: Tensor, accuracy: float) -> Proposal:
        """From the solution of one damped system."""
        solution = factor.solve(-system.gradient, accuracy)
        change = solution.values * system.structure.free
        predicted = 0.5 * float(change @ (damping * change - system.gradient + solution.remainder))
        return cls(change, predicted, solution.iterations, system, factor, damping)
