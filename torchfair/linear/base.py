"""What a linear solver gets and what it must do."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import torch
from torch import Tensor

from .lower_triangle import LowerTriangle


class Pattern(Protocol):
    """Where the matrices of one family may have entries."""

    @property
    def num_unknowns(self) -> int:
        """N."""
        ...

    @property
    def device(self) -> torch.device:
        """Of the matrices."""
        ...

    @property
    def lower(self) -> LowerTriangle:
        """Places of the lower triangle, found when first asked for; the same object as long as they are the same."""
        ...


class System(Protocol):
    """A symmetric positive semidefinite matrix A (N, N) in the guises that solvers ask for."""

    @property
    def pattern(self) -> Pattern:
        """Where A may have entries."""
        ...

    @property
    def lower_values(self) -> Tensor:
        """Values of the lower triangle, in the order of ``pattern.lower``."""
        ...

    @property
    def root(self) -> Tensor | None:
        """(rows, N) a sparse or dense matrix J with ``J^T J = A``, or None where none is known."""
        ...

    def product(self, vectors: Tensor) -> Tensor:
        """A times vectors (N,) or (N, k)."""
        ...

    def preconditioner(self, damping: Tensor) -> Tensor:
        """A sparse approximate inverse (N, N) of ``A + diag(damping)``, such as that of its diagonal blocks."""
        ...


class Solution(NamedTuple):
    """Solution of ``(A + diag(damping)) x = b`` for one or many right-hand sides.

    Attributes:
        values: (N,) or (N, k), x.
        remainder: Of the same shape, what is left of b; taken as zero by direct solvers.
        iterations: Inner iterations, 1 for direct solvers.
    """

    values: Tensor
    remainder: Tensor
    iterations: int = 1


class Factor(Protocol):
    """A matrix that is ready to be solved with, again and again."""

    def solve(self, right: Tensor, accuracy: float = ...) -> Solution:
        """Solves for right-hand sides (N,) or (N, k).

        Args:
            right: b.
            accuracy: Relative size of the remainder that is good enough; direct solvers are more accurate.

        Raises:
            SingularSystemError: the matrix is singular, indefinite or not finite.
        """
        ...


@runtime_checkable
class Descending(Protocol):
    """A factor that knows how far a solution lowers the quadratic ``x^T (A + diag(damping)) x / 2 - b^T x``.

    For a damped step that is what counts: a solution with a large remainder may lower it nearly as far as the exact
    one.
    """

    def descend(self, right: Tensor, accuracy: float) -> Solution:
        """As :meth:`Factor.solve`, ``right`` (N,) or (N, k), but ends where the quadratic hardly falls any more."""
        ...


class LinearSolver(Protocol):
    """Makes factors of damped matrices. Solvers can be copied with ``copy.copy``.

    Attributes:
        name: For reports.
        inexact: Whether solutions are only as accurate as asked for, so that it pays to start with rough ones.
    """

    name: str
    inexact: bool

    def prepare(self, pattern: Pattern) -> None:
        """Symbolic work for matrices of this pattern. With the pattern of the last call it costs nothing."""
        ...

    def factorise(self, system: System, damping: Tensor) -> Factor:
        """The matrix of a system of the prepared pattern, plus a diagonal.

        Args:
            system: See :class:`System`.
            damping: (N,) at least zero.

        Raises:
            SingularSystemError: the sum is singular, indefinite or not finite.
        """
        ...
