"""Dense solver for problems with few unknowns."""

from __future__ import annotations

import torch
from torch import Tensor

from ...errors import SingularSystemError
from ..system import LinearSystem, Structure
from .base import Step


class DenseQR:
    """Orthogonal factorisation of the stacked matrix ``[J; sqrt(damping)]``.

    The normal matrix is never formed, so badly scaled small problems keep their digits. Cost and memory are
    those of a dense matrix: for a few hundred unknowns.
    """

    name = "dense"
    inexact = False

    def prepare(self, structure: Structure) -> None:
        """Nothing to prepare."""

    def solve(self, system: LinearSystem, damping: Tensor, accuracy: float) -> Step:
        """One damped step; see the protocol."""
        jacobian = system.jacobian.to_dense()
        stacked = torch.cat([jacobian, torch.diag(damping.sqrt())])
        right = torch.cat([-system.residual_vector, torch.zeros_like(damping)])
        if not bool(torch.isfinite(stacked).all() & torch.isfinite(right).all()):
            raise SingularSystemError("the Jacobian is not finite")
        q, r = torch.linalg.qr(stacked)
        pivots = r.diagonal().abs()
        if float(pivots.min()) <= 0.0:
            raise SingularSystemError("the Jacobian has dependent columns and no damping")
        change = torch.linalg.solve_triangular(r, (q.T @ right)[:, None], upper=True)[:, 0]
        if not bool(torch.isfinite(change).all()):
            raise SingularSystemError("the Jacobian is singular to working precision")
        return Step(change, torch.zeros_like(change))
