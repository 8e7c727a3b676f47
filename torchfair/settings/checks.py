"""What settings of all jobs are checked for."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from .._numbers import check_number, is_number
from ..errors import SettingsError


def check_choice(settings: object, name: str, allowed: Sequence[str]) -> None:
    """Raises SettingsError unless the attribute ``name`` of the settings is one of the words ``allowed``."""
    value = getattr(settings, name)
    if value not in allowed:
        raise SettingsError(f"{name} must be one of {', '.join(allowed)}, got {value!r}")


def check_weights(settings: object) -> None:
    """Raises SettingsError if a weight among the settings is no number, negative, infinite or NaN."""
    weights = {name: value for name, value in vars(settings).items() if name.endswith("_weight")}
    wrong = [
        f"{name}={value!r}" for name, value in weights.items() if not (is_number(value) and 0.0 <= value < math.inf)
    ]
    if wrong:
        raise SettingsError(f"weights must be at least 0: {', '.join(wrong)}; give finite numbers")


def check_angles(settings: Any) -> None:
    """Raises SettingsError naming a field in radians that is no angle from 0 to pi; most often it is in degrees."""
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if field.metadata.get("unit") != "radians":
            continue
        check_number(field.name, value)
        if value > math.pi:
            raise SettingsError(
                f"{field.name} must be an angle of at most pi radians (180 degrees), got {value!r}; math.radians takes "
                "degrees"
            )
