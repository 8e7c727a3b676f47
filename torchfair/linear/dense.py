"""Dense solver for problems with few unknowns."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .checked_right import check_right

_REFINEMENTS = 2


class DenseQR:
    """Orthogonal factorisation of the stacked matrix ``[J; sqrt(damping)]``.

    The normal matrix is never formed, so badly scaled small problems keep their digits. A matrix that does not come
    as ``J^T J`` is factorised by Cholesky. Cost and memory are those of a dense matrix: for a few hundred unknowns.
    """

    name = "dense"
    inexact = False

    def prepare(self, pattern: Pattern) -> None:
        """Nothing to prepare."""

    def factorise(self, system: System, damping: Tensor) -> DenseFactor:
        """See the protocol."""
        root = system.root
        if root is None:
            matrix = system.product(torch.eye(damping.shape[0], dtype=damping.dtype, device=damping.device))
            return DenseFactor(_cholesky(matrix + torch.diag(damping)))
        stacked = torch.cat([root.to_dense(), torch.diag(damping.sqrt())])
        if not bool(torch.isfinite(stacked).all()):
            raise SingularSystemError("the Jacobian is not finite")
        triangle = torch.linalg.qr(stacked, mode="r").R
        if not float(triangle.diagonal().abs().min()) > 0.0:
            raise SingularSystemError("the Jacobian has dependent columns and no damping")
        return DenseFactor(triangle, stacked)


class DenseFactor:
    """An upper triangle R with ``R^T R = S^T S``; solutions are refined with S, where it is given."""

    def __init__(self, triangle: Tensor, stacked: Tensor | None = None) -> None:
        self._triangle, self._stacked = triangle, triangle if stacked is None else stacked

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        """See the protocol."""
        check_right(right, self._triangle.shape[0])
        columns = (right if right.ndim == 2 else right[:, None]).to(self._triangle.dtype)
        solution, remainder = torch.zeros_like(columns), columns
        for _ in range(1 + _REFINEMENTS):
            middle = torch.linalg.solve_triangular(self._triangle.T, remainder, upper=False)
            solution = solution + torch.linalg.solve_triangular(self._triangle, middle, upper=True)
            remainder = columns - self._stacked.T @ (self._stacked @ solution)
        if not bool(torch.isfinite(solution).all()):
            raise SingularSystemError("the matrix is singular to working precision")
        values = solution.reshape(right.shape).to(right)
        return Solution(values, torch.zeros_like(values))


def _cholesky(matrix: Tensor) -> Tensor:
    if not bool(torch.isfinite(matrix).all()):
        raise SingularSystemError("the matrix is not finite")
    factor, failed = torch.linalg.cholesky_ex(matrix)
    if int(failed):
        raise SingularSystemError(f"the matrix is not positive definite (leading minor {int(failed)})")
    triangle: Tensor = factor.T
    return triangle
