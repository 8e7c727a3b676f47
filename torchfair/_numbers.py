"""Numbers among settings, checked where they are given."""

from __future__ import annotations

import math
from numbers import Integral, Real

from .errors import SettingsError


def is_number(value: object) -> bool:
    """Whether a value is a real number of Python or NumPy, NaN and infinity included; True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool)


def check_number(
    name: str,
    value: object,
    *,
    least: float = 0.0,
    above: bool = False,
    most: float = math.inf,
    finite: bool = False,
    or_none: bool = False,
) -> None:
    """Raises SettingsError naming the setting unless it is a number between ``least`` and ``most``.

    Args:
        name: Of the setting.
        value: What was given.
        least: The smallest number allowed; itself not where ``above`` is true.
        above: See ``least``.
        most: The largest number allowed.
        finite: Whether infinity is refused.
        or_none: Whether None is allowed.
    """
    if or_none and value is None:
        return
    if is_number(value):
        number = float(value)  # type: ignore[arg-type]
        if (number > least if above else number >= least) and number <= most and not (finite and math.isinf(number)):
            return
    bounds = f"{'above' if above else 'of at least'} {least:g}" + (f" and at most {most:g}" if most < math.inf else "")
    bounds += ", or none" if or_none else ""
    raise SettingsError(f"{name} must be a {'finite ' if finite else ''}number {bounds}, got {value!r}")


def check_radians(name: str, value: float) -> None:
    """Raises SettingsError naming the setting unless it is an angle between 0 and pi."""
    if not 0 <= value <= math.pi:
        raise SettingsError(f"{name}: expected radians between 0 and pi, got {value}. Use math.radians for degrees.")


def check_count(name: str, value: object, *, least: int) -> None:
    """Raises SettingsError naming the setting unless it is a whole number of at least ``least``."""
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < least:
        raise SettingsError(f"{name} must be a whole number of at least {least}, got {value!r}")
