"""Preconditioned conjugate gradients; the matrix is never formed."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .base import Pattern, Solution, System
from .checked_right import check_right

_FEWEST = 3  # iterations before the fall of the quadratic is judged
_SHARE = 10.0  # of the accuracy: what the last quarter of the iterations must bring of the fall
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
        return self._run(right, accuracy, 0.0)

    def descend(self, right: Tensor, accuracy: float) -> Solution:
        """The same, to an end as soon as the quadratic has all but stopped falling; see :class:`Descending`.

        The first few iterations make most of the fall, the others work on remainders that hardly matter for it. What is
        left is judged by what the last quarter of the iterations brought (about as Nash and Sofer 1990 do by the last).
        """
        return self._run(right, accuracy, _SHARE * accuracy)

    def _run(self, right: Tensor, accuracy: float, share: float) -> Solution:
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
        falls = [torch.zeros_like(energy)]  # of the quadratic, so far
        iterations = 0
        while iterations < self._max_iterations:
            active = torch.linalg.vector_norm(remainder, dim=0) > target
            if share > 0.0 and iterations >= _FEWEST:
                active &= falls[-1] - falls[-1 - max(2, -(-iterations // 4))] > share * falls[-1]
            if iterations % every == 0 and _is_done(active, healthy):
                break
            image = self._system.product(direction).addcmul_(damping, direction)
            curvature = _dots(direction, image)
            healthy = healthy & ((curvature > 0.0) | ~active).all()
            length = torch.where(active, energy / curvature, 0.0)
            falls.append(torch.addcmul(falls[-1], length, energy, value=0.5))
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
