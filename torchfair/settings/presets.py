"""Presets: settings that a dataclass makes under a name, such as those of the printed method."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from ..errors import SettingsError

S = TypeVar("S")

_NAMES = ("paper",)


def presets_of(kind: type[S]) -> dict[str, Callable[..., S]]:
    """Class methods of a settings dataclass that make whole settings, by name."""
    return {name: getattr(kind, name) for name in _NAMES if hasattr(kind, name)}


def preset_settings(text: str, kind: type[S]) -> S:
    """The settings of a preset, with its own numbers changed: ``"paper"``, ``"paper,w_fair=0.3,w_reg=1e-3"``.

    Args:
        text: Name of the preset, then arguments of its class method.
        kind: The settings dataclass.

    Raises:
        SettingsError: there is no such preset, number, or value; names what is allowed.
    """
    name, *words = text.split(",")
    presets = presets_of(kind)
    if name not in presets:
        raise SettingsError(f"presets are {', '.join(presets) or 'none'}, got '{name}'")
    numbers = inspect.signature(presets[name]).parameters
    return presets[name](**dict(_number(word, name, numbers) for word in words))


def _number(word: str, preset: str, numbers: Mapping[str, inspect.Parameter]) -> tuple[str, Any]:
    key, sign, value = word.partition("=")
    if key not in numbers or not sign:
        raise SettingsError(f"numbers of the preset '{preset}' are {', '.join(numbers)}, as NAME=X, got '{word}'")
    kind = type(numbers[key].default)
    try:
        found = kind(value)
    except ValueError:
        found = math.nan
    if not 0.0 <= found < math.inf:
        wanted = "a whole number" if kind is int else "a number"
        raise SettingsError(f"preset '{preset}': {key} must be {wanted} of at least 0, got '{value}'")
    return key, found
