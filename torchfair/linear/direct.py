"""What sparse direct solvers have in common: assemble the matrix, factorise, substitute."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .checked_right import check_right
from .lower_triangle import LowerTriangle

TIGHTEST = 1e-12  # relative remainder of every solution, so that results do not depend on how sums are rounded

Substitution = Callable[[np.ndarray, float], np.ndarray]


class SparseDirect(ABC):
    """A direct solver: :meth:`analyse` looks at the pattern, :meth:`factor` at the numbers."""

    name: str
    inexact = False
    _lower: LowerTriangle | None = None

    def prepare(self, pattern: Pattern) -> None:
        """Symbolic work; see the protocol."""
        if self._lower is None or not self._lower.equals(pattern.lower):
            self.analyse(pattern.lower)
        self._lower = pattern.lower

    @abstractmethod
    def analyse(self, lower: LowerTriangle) -> None:
        """Symbolic work, once for each pattern."""

    @abstractmethod
    def factor(self, values: np.ndarray) -> Substitution:
        """Factors the lower triangle with ``values`` in the order of the pattern, in double precision.

        Returns:
            The map from right-hand sides (N,) or (N, k), and the relative remainder that is good enough (smaller is
            always allowed), to solutions.

        Raises:
            SingularSystemError: the matrix is singular or indefinite.
        """

    def assemble(self, system: System, damping: Tensor) -> np.ndarray:
        """Values of the lower triangle of the matrix damped by (N,), in double precision."""
        values = system.lower_values.cpu().numpy().astype(np.float64)
        values[system.pattern.lower.diagonal] += damping.cpu().numpy()
        if not math.isfinite(values.sum()):
            raise SingularSystemError("the matrix is not finite")
        return values

    def factorise(self, system: System, damping: Tensor) -> DirectFactor:
        """See the protocol."""
        return DirectFactor(self.factor(self.assemble(system, damping)), damping.shape[0])


class DirectFactor:
    """A factor whose solutions have no remainder to speak of."""

    def __init__(self, substitute: Substitution, size: int) -> None:
        self._substitute, self._size = substitute, size

    def solve(self, right: Tensor, accuracy: float = TIGHTEST) -> Solution:
        """See the protocol."""
        check_right(right, self._size)
        solution = self._substitute(right.cpu().numpy().astype(np.float64), accuracy)
        if not np.isfinite(solution).all():
            raise SingularSystemError("the matrix is singular to working precision")
        values = torch.from_numpy(solution).to(right)
        return Solution(values, torch.zeros_like(values))
