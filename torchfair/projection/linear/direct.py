"""What sparse direct solvers have in common: assemble the normal matrix, factorise, substitute."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from ...errors import SingularSystemError
from ..system import LinearSystem, Structure
from .base import Step

Substitution = Callable[[np.ndarray], np.ndarray]


class SparseDirect(ABC):
    """A direct solver: :meth:`prepare` analyses the pattern, :meth:`factorise` does the rest."""

    name: str
    inexact = False

    @abstractmethod
    def prepare(self, structure: Structure) -> None:
        """Symbolic work, once for each structure."""

    @abstractmethod
    def factorise(self, values: np.ndarray, accuracy: float) -> Substitution:
        """Factors the lower triangle with ``values`` in the order of the normal pattern.

        Args:
            values: In double precision.
            accuracy: Relative remainder of the solution that is good enough; smaller is always allowed.

        Returns:
            The map from a right-hand side to the solution.

        Raises:
            SingularSystemError: the matrix is singular or indefinite.
        """

    def assemble(self, system: LinearSystem, damping: Tensor) -> np.ndarray:
        """Lower triangle of ``J^T J + diag(damping)``, in double precision."""
        values = system.normal_values.cpu().numpy().astype(np.float64)
        values[system.structure.normal_pattern.offsets[:-1]] += damping.cpu().numpy()
        if not math.isfinite(values.sum()):
            raise SingularSystemError("the normal matrix is not finite")
        return values

    def solve(self, system: LinearSystem, damping: Tensor, accuracy: float) -> Step:
        """One damped step; see the protocol."""
        substitute = self.factorise(self.assemble(system, damping), accuracy)
        solution = substitute(-system.gradient.cpu().numpy().astype(np.float64))
        if not np.isfinite(solution).all():
            raise SingularSystemError("the normal matrix is singular to working precision")
        change = torch.from_numpy(solution).to(system.gradient)
        return Step(change, torch.zeros_like(change))
