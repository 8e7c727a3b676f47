"""What a linear solver must do."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from torch import Tensor

from ..system import LinearSystem, Structure


class Step(NamedTuple):
    """Solution of ``(J^T J + diag(damping)) d = -J^T r``.

    Attributes:
        change: (N,) the step d.
        remainder: (N,) what is left, ``-J^T r - (J^T J + diag(damping)) d``; taken as zero by
            direct solvers.
        iterations: inner iterations, 1 for direct solvers.
    """

    change: Tensor
    remainder: Tensor
    iterations: int = 1


class LinearSolver(Protocol):
    """Solves the damped normal equations of one structure again and again.

    Attributes:
        name: For reports.
        inexact: Whether steps are only as accurate as asked for, so that it pays to start with rough ones.
    """

    name: str
    inexact: bool

    def prepare(self, structure: Structure) -> None:
        """Symbolic work, once for each structure."""
        ...

    def solve(self, system: LinearSystem, damping: Tensor, accuracy: float) -> Step:
        """One damped step.

        Args:
            system: Jacobians and residuals.
            damping: (N,) positive diagonal.
            accuracy: Relative size of the remainder that is good enough; direct solvers are
                more accurate.

        Raises:
            SingularSystemError: the matrix is singular, indefinite or not finite.
        """
        ...
