"""What a residual costs: squares, or a smoothed norm treated by iterative reweighting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import torch
from torch import Tensor

from .._numbers import check_number


class Loss(Protocol):
    """What an element's residual costs, and the quadratic model of that cost.

    The model ``|root r|^2 / 2`` has the gradient of :meth:`value` where it is made and rises at least as
    fast from there, so that a step which lowers the model lowers the merit.
    """

    def value(self, residuals: Tensor) -> Tensor:
        """(n,) contributions to the merit of residuals ``(n, m)``, at least 0."""
        ...

    def root(self, residuals: Tensor) -> Tensor:
        """Square roots of the weights of the quadratic model made at residuals ``(n, m)``.

        Returns:
            (n,) numbers, or matrices (n, m, m) where components are weighted differently.
        """
        ...


def is_one_sided(loss: Loss) -> bool:
    """Whether components below zero cost nothing: the loss has a true attribute ``one_sided``."""
    return bool(getattr(loss, "one_sided", False))


@dataclass(frozen=True)
class Squares:
    """Least squares, ``|r|^2 / 2``."""

    def value(self, residuals: Tensor) -> Tensor:
        """Half the squared norm (n,) of residuals (n, m)."""
        return 0.5 * residuals.square().sum(1)

    def root(self, residuals: Tensor) -> Tensor:
        """One (n,) for each of residuals (n, m), the same number in memory."""
        return residuals.new_ones(1).expand(residuals.shape[0])


@dataclass(frozen=True)
class Rounded:
    """What losses share that are rounded within ``epsilon`` of zero, which is a finite number above 0."""

    epsilon: float

    def __post_init__(self) -> None:
        check_number(f"epsilon of {type(self).__name__}", self.epsilon, above=True, finite=True)


@dataclass(frozen=True)
class SmoothAbsolute(Rounded):
    r"""Smoothed norm ``sqrt(|r|^2 + epsilon^2) - epsilon``; tends to ``|r|`` as epsilon goes to zero.

    The quadratic model with weight ``1 / sqrt(|r_prev|^2 + epsilon^2)`` lies above the smoothed norm and
    touches it at ``r_prev``, so that a step which lowers the model lowers the merit (paper section 5.3,
    "weight iteration").

    Attributes:
        epsilon: Above 0, in the unit of the residual.

    Raises:
        SettingsError: epsilon is not a finite number above 0.
    """

    def value(self, residuals: Tensor) -> Tensor:
        """``sqrt(|r|^2 + epsilon^2) - epsilon`` (n,) of residuals (n, m), evaluated without cancellation."""
        squared = residuals.square().sum(1)
        return squared / (torch.sqrt(squared + self.epsilon**2) + self.epsilon)

    def root(self, residuals: Tensor) -> Tensor:
        """``(|r|^2 + epsilon^2)^(-1/4)`` (n,) of residuals (n, m)."""
        return torch.rsqrt(torch.sqrt(residuals.square().sum(1) + self.epsilon**2))


@dataclass(frozen=True)
class LogAbsolute(Rounded):
    r"""The absolute value as the paper reweights it: ``|r| - epsilon log(1 + |r| / epsilon)``.

    Its quadratic model is that of paper section 5.3, ``r^2 / (|r_prev| + epsilon)``, half of it. Iterated reweighting
    with these weights lowers this function (Fair 1974), which tends to ``|r|`` as epsilon goes to zero: less by
    ``epsilon log(1 + |r| / epsilon)``, so more slowly than :class:`SmoothAbsolute`, which is less by at most epsilon.

    Attributes:
        epsilon: Above 0, in the unit of the residual.

    Raises:
        SettingsError: epsilon is not a finite number above 0.
    """

    def value(self, residuals: Tensor) -> Tensor:
        """``|r| - epsilon log(1 + |r| / epsilon)`` (n,) of residuals (n, m), never below zero."""
        sizes: Tensor = torch.linalg.vector_norm(residuals, dim=1)
        return (sizes - self.epsilon * torch.log1p(sizes / self.epsilon)).clamp_min(0.0)

    def root(self, residuals: Tensor) -> Tensor:
        """``(|r| + epsilon)^(-1/2)`` (n,) of residuals (n, m)."""
        sizes: Tensor = torch.linalg.vector_norm(residuals, dim=1)
        return torch.rsqrt(sizes + self.epsilon)


@dataclass(frozen=True)
class OneSided:
    """``|max(r, 0)|^2 / 2``: every component is an inequality ``r <= 0``.

    The model of a damped step knows about components below zero too, so that a step does not break what holds where it
    starts: see "How the solver decides" in the documentation.
    """

    one_sided: ClassVar[bool] = True

    def value(self, residuals: Tensor) -> Tensor:
        """Half the squared norm (n,) of the components of residuals (n, m) above zero."""
        return 0.5 * residuals.clamp_min(0.0).square().sum(1)

    def root(self, residuals: Tensor) -> Tensor:
        """One (n,), for the components of residuals (n, m) that are heeded; the same number in memory."""
        return residuals.new_ones(1).expand(residuals.shape[0])


def apply_root(root: Tensor, values: Tensor) -> Tensor:
    """Roots (n,) or (n, m, m) times residuals ``(n, m)`` or Jacobians ``(n, m, K)``."""
    if root.ndim == 1:
        return values * root.reshape(-1, *[1] * (values.ndim - 1))
    return torch.einsum("nij,nj...->ni...", root, values)
