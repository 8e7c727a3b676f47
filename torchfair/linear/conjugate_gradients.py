"""Preconditioned conjugate gradients; the matrix is never formed."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .checked_right import check_right

_CHECK_EVERY = 10  # iterations on other devices than the CPU, where looking at a number makes everything wait


class ConjugateGradients:
    """Conjugate gradients with the preconditioner of the system, on CPU or GPU.

    Args:
        max_iterations: Bound on the iterations for one right-hand side; the solution reached then is used as it is
            (every iterate from zero is a better approximation in the norm of the matrix).
        tightest: The smallest relative remainder that is ever asked for.
    """

    name = "conjugate gradients"
    inexact = True

    def __init__(self, max_iterations: int = 500, tightest: float = 1e-10) -> None:
        self.max_iterations = max_iterations
        self.tightest = tightest

    def prepare(self, pattern: Pattern) -> None:
        """Nothing to prepare."""

    def factorise(self, system: System, damping: Tensor) -> ConjugateGradientFactor:
        """The system with its preconditioner; see the protocol."""
        return ConjugateGradientFactor(system, damping, self.max_iterations, self.tightest)


class ConjugateGradientFactor:
    """A damped system with its preconditioner."""

    def __init__(self, system: System, damping: Tensor, max_iterations: int, tightest: float) -> None:
        self._system, self._damping = system, damping
        self._max_iterations, self._tightest = max_iterations, tightest
        self._inverse = system.preconditioner(damping)

    def solve(self, right: Tensor, accuracy: float = 0.0) -> Solution:
        """All right-hand sides at once, each with steps of its own; see the protocol."""
        check_right(right, self._damping.shape[0])
        given, right = right, right.to(self._inverse.dtype)
        damping = self._damping if right.ndim == 1 else self._damping[:, None]
        every = 1 if right.device.type == "cpu" else _CHECK_EVERY
        remainder = right.clone()
        target = max(accuracy, self._tightest) * torch.linalg.vector_norm(right, dim=0)
        change = torch.zeros_like(remainder)
        direction = self._inverse @ remainder
        energy = _dots(remainder, direction)
        healthy = (energy >= 0.0).all()
        iterations = 0
        while iterations < self._max_iterations:
            active = torch.linalg.vector_norm(remainder, dim=0) > target
            if iterations % every == 0 and _is_done(active, healthy):
                break
            image = self._system.product(direction).addcmul_(damping, direction)
            curvature = _dots(direction, image)
            healthy = healthy & ((curvature > 0.0) | ~active).all()
            length = torch.where(active, energy / curvature, 0.0)
            change.addcmul_(length, direction)
            remainder.addcmul_(length, image, value=-1.0)
            preconditioned = self._inverse @ remainder
            previous, energy = energy, _dots(remainder, preconditioned)
            direction = preconditioned.addcmul_(torch.where(active, energy / previous, 0.0), direction)
            iterations += 1
        _is_done(healthy, healthy)
        return Solution(change.to(given), remainder.to(given), iterations)


def _is_done(active: Tensor, healthy: Tensor) -> bool:
    """Whether nothing is active any more; looks at one number.

    Raises:
        SingularSystemError: what was computed is not healthy.
    """
    state = int(torch.where(healthy, active.any().to(torch.int8), -1))
    if state < 0:
        raise SingularSystemError("the matrix or its preconditioner is singular, indefinite or not finite")
    return state == 0


def _dots(left: Tensor, right: Tensor) -> Tensor:
    """Scalar products () of vectors (N,), or (k,) of columns (N, k)."""
    return left @ right if left.ndim == 1 else torch.einsum("nk,nk->k", left, right)
