"""Preconditioned conjugate gradients on the stored Jacobian; the normal matrix is never formed."""

from __future__ import annotations

import torch
from torch import Tensor

from ...errors import SingularSystemError
from ..system import LinearSystem, Structure
from .base import Step


class ConjugateGradients:
    """Conjugate gradients, preconditioned by the diagonal block of every node, on CPU or GPU.

    Args:
        max_iterations: Bound on the inner iterations of one step; the step reached then is used as it is
            (every iterate of conjugate gradients from zero lowers the quadratic model).
        tightest: The smallest relative remainder that is ever asked for.
    """

    name = "conjugate gradients"
    inexact = True

    def __init__(self, max_iterations: int = 500, tightest: float = 1e-10) -> None:
        self.max_iterations = max_iterations
        self.tightest = tightest

    def prepare(self, structure: Structure) -> None:
        """Nothing to prepare."""

    def solve(self, system: LinearSystem, damping: Tensor, accuracy: float) -> Step:
        """One damped step; see the protocol."""
        jacobian, transpose = system.jacobian, system.jacobian_transpose
        inverse = preconditioner(system, damping)
        remainder = -system.gradient
        target = max(accuracy, self.tightest) * float(remainder.norm())
        change = torch.zeros_like(remainder)
        direction = inverse @ remainder
        energy = float(remainder @ direction)
        if not energy >= 0.0:
            raise SingularSystemError("the preconditioner is not positive definite or not finite")
        iterations = 0
        while float(remainder.norm()) > target and iterations < self.max_iterations:
            image = (transpose @ (jacobian @ direction)).addcmul_(damping, direction)
            curvature = float(direction @ image)
            if not curvature > 0.0:
                raise SingularSystemError("the normal matrix is singular, indefinite or not finite")
            length = energy / curvature
            change.add_(direction, alpha=length)
            remainder.sub_(image, alpha=length)
            preconditioned = inverse @ remainder
            previous, energy = energy, float(remainder @ preconditioned)
            direction = preconditioned.add_(direction, alpha=energy / previous)
            iterations += 1
        return Step(change, remainder, iterations)


def preconditioner(system: LinearSystem, damping: Tensor) -> Tensor:
    """Inverse of the damped diagonal blocks, as a CSR matrix."""
    parts = system.structure.layout.unflatten(damping)
    inverses = [invert(block + torch.diag_embed(parts[name])) for name, block in system.diagonal_blocks.items()]
    return system.structure.block_diagonal.matrix(torch.cat([inverse.reshape(-1) for inverse in inverses]))


def invert(blocks: Tensor) -> Tensor:
    """Inverses of symmetric positive definite ``(n, d, d)``; closed form for d <= 3, where LAPACK is slow."""
    size = blocks.shape[-1]
    if size == 1:
        return 1.0 / blocks
    if size == 3:
        a, b, c = blocks.unbind(-2)
        adjugate = torch.stack([torch.linalg.cross(b, c), torch.linalg.cross(c, a), torch.linalg.cross(a, b)], dim=-1)
        return adjugate / (a * adjugate[..., 0]).sum(-1)[..., None, None]
    inverse: Tensor = torch.linalg.inv(blocks)
    return inverse
