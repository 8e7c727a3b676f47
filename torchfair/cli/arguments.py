"""Types of command-line arguments, with messages that say what was expected."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from .errors import CommandError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Settings = TypeVar("Settings", bound=DataclassInstance)


def count(text: str) -> int:
    """A whole number, at least 0."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 0, got {text!r}")
    return value


def positive_count(text: str) -> int:
    """A whole number, at least 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, got {text!r}")
    return value


def non_negative(text: str) -> float:
    """A finite number, at least 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0):
        raise argparse.ArgumentTypeError(f"expected a number of at least 0, got {text!r}")
    return value


def turning_angle(text: str) -> float:
    """Radians of an angle given in degrees, 0 to 180."""
    value = non_negative(text)
    if value > 180.0:
        raise argparse.ArgumentTypeError(f"expected degrees from 0 to 180, got {text!r}")
    return math.radians(value)


def with_settings(defaults: Settings, **changes: Any) -> Settings:
    """Settings of a job, a dataclass, with some fields changed; what it does not accept is a wrong use."""
    try:
        return replace(defaults, **changes)
    except ValueError as error:
        raise CommandError(str(error)) from None


def positive_or_none(text: str) -> float | None:
    """A finite number above 0, or the word none."""
    if text.lower() == "none":
        return None
    value = non_negative(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError("expected a number above 0, or none")
    return value


def vertex_target(vertex: str, *place: str) -> tuple[int, list[float]]:
    """A vertex number and where it is pulled to."""
    try:
        return count(vertex), [float(word) for word in place]
    except (argparse.ArgumentTypeError, ValueError):
        words = " ".join((vertex, *place))
        raise CommandError(f"--handle: expected a vertex number and three coordinates, got '{words}'") from None
