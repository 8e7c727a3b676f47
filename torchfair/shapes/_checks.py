"""Checks of constructor arguments."""

from __future__ import annotations

import math
from numbers import Integral

from torchfair.errors import TorchfairError

from ._quadrature import Interval


def require_positive(**values: float) -> None:
    """Raises TorchfairError naming the first value that is not finite and positive."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise TorchfairError(f"{name} must be a positive number, got {value}")


def require_finite(**values: float) -> None:
    """Raises TorchfairError naming the first value that is not finite."""
    for name, value in values.items():
        if not math.isfinite(value):
            raise TorchfairError(f"{name} must be a finite number, got {value}")


def require_interval(longest: float = math.inf, **values: Interval) -> None:
    """Raises TorchfairError naming the first interval that is not ``(low, high)`` with low < high."""
    for name, value in values.items():
        if len(value) != 2 or not all(map(math.isfinite, value)) or not value[0] < value[1]:
            raise TorchfairError(f"{name} must be two finite numbers (low, high) with low < high, got {value}")
        if value[1] - value[0] > longest * (1 + 1e-12):
            raise TorchfairError(f"{name} must span at most {longest:.6g}, got {value}")


def is_integer_from(least: int, value: object) -> bool:
    """Whether ``value`` is an integer, of any integer type, not below ``least``."""
    return isinstance(value, Integral) and int(value) >= least


def is_full_turn(angles: Interval) -> bool:
    """Whether an interval of angles closes up."""
    return abs(angles[1] - angles[0] - 2 * math.pi) <= 1e-12
