"""A damped step, before anyone knows whether it lowers the merit."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from ..linear import Descending, Factor, LinearSolver, Solution
from .evaluation import Evaluation
from .linear_system import LinearSystem


@dataclass(frozen=True)
class Proposal:
    """A step to be tried.

    Attributes:
        change: (N,) zero at fixed unknowns.
        predicted: (members,) by how much the merit of the linearised residuals falls.
        iterations: Of the linear solver, over all systems solved.
        system, factor: The last system that was solved for the step, and its damped matrix.
        damping: (N,) its diagonal.
        heeded: Inequalities that the system takes for equations, if there are any.
        lost: Members whose own part of the system is singular: they are left out of it and do not move.
    """

    change: Tensor
    predicted: Tensor
    iterations: int
    system: LinearSystem
    factor: Factor
    damping: Tensor
    heeded: Tensor | None = None
    lost: frozenset[int] = frozenset()

    @classmethod
    def of(cls, system: LinearSystem, solver: LinearSolver, damping: Tensor, accuracy: float) -> Proposal:
        """From the solution of one damped system."""
        structure, factor = system.structure, solver.factorise(system, damping)
        solution = descend(factor, -system.gradient, accuracy)
        change = solution.values * structure.free
        fall = 0.5 * structure.layout.member_sums(change * (damping * change - system.gradient + solution.remainder))
        return cls(change, fall, solution.iterations, system, factor, damping)

    def correction(self, trial: Evaluation, step: Tensor, accuracy: float) -> Tensor:
        """(N,) what is to be added to the step because residuals are curved.

        Stiff curved constraints bend away from the linear model: ``r(x + d) = r + J d + (second order)``. With the
        residuals seen at the trial the same damped problem is solved once more, now for the second-order part; the
        factor is known, so this costs one substitution (second-order correction, Nocedal and Wright, section 15.6).

        Args:
            trial: The state after ``step``.
            step: (N,) the step tried.
            accuracy: Relative remainder of the linear solution that is good enough.
        """
        right = -(self.system.gradient_with(trial) + self.damping * step)
        correction: Tensor = descend(self.factor, right, accuracy).values * self.system.structure.free
        return correction


def descend(factor: Factor, right: Tensor, accuracy: float) -> Solution:
    """A solution good enough for a step: iterative solvers stop where the model hardly falls any more."""
    return (factor.descend if isinstance(factor, Descending) else factor.solve)(right, accuracy)
