"""What a residual costs: squares, or a smoothed absolute value treated by iterative reweighting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor


class Loss(Protocol):
    """A concave function of the squared norm ``s = |r|^2`` of an element's residual."""

    def value(self, squared: Tensor) -> Tensor:
        """Contribution to the merit."""
        ...

    def weight(self, squared: Tensor) -> Tensor:
        """Twice the derivative of :meth:`value`: the weight of ``|r|^2 / 2`` in the quadratic model."""
        ...


@dataclass(frozen=True)
class Squares:
    """Least squares, ``|r|^2 / 2``."""

    def value(self, squared: Tensor) -> Tensor:
        """Half the squared norm."""
        return 0.5 * squared

    def weight(self, squared: Tensor) -> Tensor:
        """One."""
        return torch.ones_like(squared)


@dataclass(frozen=True)
class SmoothAbsolute:
    r"""Smoothed norm ``sqrt(|r|^2 + epsilon^2) - epsilon``; tends to ``|r|`` as epsilon goes to zero.

    The quadratic model with weight ``1 / sqrt(|r_prev|^2 + epsilon^2)`` lies above the smoothed norm and
    touches it at ``r_prev``, so that a step which lowers the model lowers the merit (paper section 5.3,
    "weight iteration").
    """

    epsilon: float

    def value(self, squared: Tensor) -> Tensor:
        """``sqrt(s + epsilon^2) - epsilon``, evaluated without cancellation."""
        return squared / (torch.sqrt(squared + self.epsilon**2) + self.epsilon)

    def weight(self, squared: Tensor) -> Tensor:
        """``1 / sqrt(s + epsilon^2)``."""
        return torch.rsqrt(squared + self.epsilon**2)
