"""Types of command-line arguments, with messages that say what was expected."""

from __future__ import annotations

import argparse
import math


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


def positive_or_none(text: str) -> float | None:
    """A finite number above 0, or the word none."""
    if text.lower() == "none":
        return None
    value = non_negative(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError("expected a number above 0, or none")
    return value


def finite(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, got {text!r}")
    return value


def degrees(text: str) -> float:
    """An angle in degrees, from 0 to 180."""
    value = non_negative(text)
    if value > 180.0:
        raise argparse.ArgumentTypeError(f"expected degrees from 0 to 180, got {text!r}")
    return value
