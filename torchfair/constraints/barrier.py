"""A one-sided residual that is zero in the safe region and infinite beyond a bound."""

from __future__ import annotations

import torch
from torch import Tensor

_SOFTENING = 0.1


def barrier(margin: Tensor, safe: Tensor) -> Tensor:
    r"""Zero where ``margin >= safe``, rising as the margin shrinks, infinite where it is negative.

    With ``s = 0.1 safe`` the value is ``(safe + s) / (margin + s) - 1``: 10 at the bound itself, so that a
    start exactly on the bound is legal, and steep enough to lead away from it. A state beyond the bound has
    no finite merit, so damped steps never cross it.

    Args:
        margin: (...) distance from the bound, in any unit; differentiable.
        safe: (...) margin from which on the barrier is silent, positive, same unit.
    """
    softening = _SOFTENING * safe
    inside = torch.where(margin < 0.0, torch.zeros_like(margin), margin)
    value = (safe + softening) / (inside + softening) - 1.0
    value = torch.where(margin >= safe, torch.zeros_like(value), value)  # NaN does not pass for safe
    return torch.where(margin < 0.0, torch.full_like(value, torch.inf), value)


def barrier_slope(margin: Tensor, safe: Tensor) -> Tensor:
    """Derivative of :func:`barrier` by the margin: at most zero; zero too where the barrier is infinite."""
    softening = _SOFTENING * safe
    active = (margin >= 0.0) & (margin < safe)
    shifted = torch.where(active, margin, torch.zeros_like(margin)) + softening
    return torch.where(active, -(safe + softening) / (shifted * shifted), torch.zeros_like(margin))
