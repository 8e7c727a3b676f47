"""Values that commands hold: each is checked, and given back as it is used."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .limits import MOST_NUMBERED

_MOST_TEXT = 4096
_LARGEST = 1e15

Check = Callable[[object], Any]
"""Gives the value; ValueError that says what is expected."""


def flag(value: object) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise ValueError("expected true or false")
    return value


def whole(least: int, most: int) -> Check:
    """A whole number in a range."""

    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise ValueError(f"expected a whole number from {least} to {most}")
        return value

    return check


def number(value: object) -> float:
    """A finite number."""
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
    if not whole and not isinstance(value, float):
        raise ValueError("expected a number")
    found = float(value)  # type: ignore[arg-type]
    if not (math.isfinite(found) and abs(found) <= _LARGEST):
        raise ValueError(f"expected a finite number of at most {_LARGEST:g}")
    return found


def text(value: object) -> str:
    """A text, not empty, not long."""
    if not isinstance(value, str) or not 0 < len(value) <= _MOST_TEXT or "\0" in value:
        raise ValueError(f"expected a text of 1 to {_MOST_TEXT} characters")
    if any(0xD800 <= ord(letter) <= 0xDFFF for letter in value):
        raise ValueError("expected a text that can be written in UTF-8")
    return value


def one_of(*words: str) -> Check:
    """One of some words."""

    def check(value: object) -> str:
        if not isinstance(value, str) or value not in words:
            raise ValueError(f"expected one of {', '.join(words)}")
        return value

    return check


def data(value: object) -> bytes:
    """Bytes."""
    if not isinstance(value, bytes):
        raise ValueError("expected bytes, which only a container holds")
    return value


def items(check: Check, *, least: int = 0, most: int = MOST_NUMBERED) -> Check:
    """A list of so many."""

    def check_all(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise ValueError(f"expected a list of {least} to {most}")
        return tuple(check(item) for item in value)

    return check_all


def place(value: object) -> tuple[int, tuple[float, float, float]]:
    """A vertex and where it is pulled."""
    if not isinstance(value, list) or len(value) != 4:
        raise ValueError("expected [vertex, x, y, z]")
    x, y, z = (number(item) for item in value[1:])
    return vertex(value[0]), (x, y, z)


def places(value: object) -> dict[int, tuple[float, float, float]]:
    """Places by vertex, each vertex once."""
    pairs = items(place, least=1, most=10_000)(value)
    if len(dict(pairs)) < len(pairs):
        raise ValueError("expected each vertex once")
    return dict(pairs)


def named(check: Check, most: int = 40) -> Check:
    """Values by name."""

    def check_all(value: object) -> dict[str, Any]:
        if not isinstance(value, dict) or not 0 < len(value) <= most:
            raise ValueError(f"expected an object of 1 to {most} names")
        return {text(name): check(item) for name, item in value.items()}

    return check_all


def weight(value: object) -> float:
    """A weight, not negative."""
    found = number(value)
    if found < 0.0:
        raise ValueError("expected a weight of at least 0")
    return found


point = items(number, least=3, most=3)


def camera(value: object) -> dict[str, Any]:
    """A camera."""
    names = {"position": point, "target": point, "up": point, "fov": number, "orthographic": flag}
    if not isinstance(value, dict) or set(value) != set(names):
        raise ValueError(f"expected an object of {', '.join(names)}")
    return {name: check(value[name]) for name, check in names.items()}


vertex = whole(0, MOST_NUMBERED)
vertices = items(vertex, least=1)
views = items(one_of("stars", "deviation", "planarity"), most=3)
