"""Kinds of values that settings have, and how each is written in files and on a command line."""

from __future__ import annotations

import math
import types
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Literal, Union, get_args, get_origin

from .._numbers import is_number


class Kind(ABC):
    """One kind of value.

    Attributes:
        words: What is expected in a file, in words.
        symbol: For the help of options.
    """

    words: str
    symbol: str

    @property
    def spoken(self) -> str:
        """What is expected on a command line, in words; the same unless units differ."""
        return self.words

    @abstractmethod
    def read(self, value: object) -> Any:
        """The setting from a value of JSON or TOML; ValueError for one of another kind."""

    @abstractmethod
    def parse(self, text: str) -> Any:
        """The setting from a word of a command line; ValueError for one of another kind."""

    def show(self, value: Any) -> str:
        """A value of this kind as it is written on a command line; ValueError for one of another kind."""
        self.read(value)
        return str(value)


class Number(Kind):
    """A number; radians are given in degrees on a command line."""

    def __init__(self, unit: str = "") -> None:
        self._is_angle = unit == "radians"
        self.words = f"a number of {unit}" if unit else "a number"
        self.symbol = "DEGREES" if self._is_angle else "X"

    @property
    def spoken(self) -> str:
        """Degrees for angles."""
        return "degrees from 0 to 180" if self._is_angle else self.words

    def read(self, value: object) -> float:
        """Infinity may also be the words inf and -inf, which JSON needs."""
        try:
            number = float(value) if is_number(value) or value in ("inf", "-inf") else math.nan  # type: ignore[arg-type]
        except OverflowError:  # whole numbers of hundreds of digits
            number = math.nan
        if math.isnan(number):
            raise ValueError(value)
        return number

    def parse(self, text: str) -> float:
        """Radians of an angle in degrees."""
        number = self.read(float(text))
        if self._is_angle and not 0.0 <= number <= 180.0:
            raise ValueError(text)
        return math.radians(number) if self._is_angle else number

    def show(self, value: Any) -> str:
        """Degrees of an angle."""
        number = self.read(value)
        return f"{math.degrees(number) if self._is_angle else number:g}"


class Count(Kind):
    """A whole number."""

    words, symbol = "a whole number", "N"

    def read(self, value: object) -> int:
        """Neither true nor 2.0."""
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(value)
        return value

    def parse(self, text: str) -> int:
        """Digits."""
        return int(text)


class Word(Kind):
    """One of some words."""

    def __init__(self, choices: Sequence[str]) -> None:
        self._choices = tuple(choices)
        self.words = f"one of {', '.join(choices)}" if len(choices) > 1 else choices[0]
        self.symbol = "|".join(choices)

    def read(self, value: object) -> str:
        """The word itself."""
        if not isinstance(value, str) or value not in self._choices:
            raise ValueError(value)
        return value

    def parse(self, text: str) -> str:
        """The word itself."""
        return self.read(text)


class Nothing(Kind):
    """None, written none."""

    words, symbol = "none", "none"

    def read(self, value: object) -> None:
        """Null in JSON; TOML has no such thing and says none."""
        if value is not None and value != "none":
            raise ValueError(value)

    def parse(self, text: str) -> None:
        """The word none."""
        self.read(text.lower())

    def show(self, value: Any) -> str:
        """The word none."""
        self.read(value)
        return "none"


class Switch(Kind):
    """True or false."""

    words, symbol = "true or false", "true|false"

    def read(self, value: object) -> bool:
        """Neither 0 nor 1."""
        if not isinstance(value, bool):
            raise ValueError(value)
        return value

    def parse(self, text: str) -> bool:
        """The word true or false."""
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"

    def show(self, value: Any) -> str:
        """The word true or false."""
        return "true" if self.read(value) else "false"


class Several(Kind):
    """A tuple, with commas on a command line."""

    def __init__(self, each: Kind) -> None:
        self._each = each
        self.words = f"a list, each {each.words}"
        self.symbol = f"{each.symbol},{each.symbol},..."

    @property
    def spoken(self) -> str:
        """With commas."""
        return f"{self._each.spoken}, or more with commas between them, or none"

    def read(self, value: object) -> tuple[Any, ...]:
        """A list of any length."""
        if not isinstance(value, list | tuple):
            raise ValueError(value)
        return tuple(self._each.read(item) for item in value)

    def parse(self, text: str) -> tuple[Any, ...]:
        """Split at commas; the word none is the empty tuple."""
        return () if text.lower() == "none" else tuple(self._each.parse(item) for item in text.split(","))

    def show(self, value: Any) -> str:
        """With commas."""
        return ",".join(self._each.show(item) for item in self.read(value)) or "none"


def kinds_of(hint: Any, unit: str = "", choices: Sequence[str] = ()) -> tuple[Kind, ...]:
    """The kinds of value that a type allows; objects that cannot be written are left out.

    Raises:
        TypeError: nothing of this type can be written.
    """
    kinds = tuple(_kinds(hint, unit, choices))
    if not kinds:
        raise TypeError(f"settings of type {hint} cannot be written: give them a type of numbers or words")
    return kinds


def _kinds(hint: Any, unit: str, choices: Sequence[str]) -> list[Kind]:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return [kind for alternative in arguments for kind in _kinds(alternative, unit, choices)]
    if origin is Literal:
        return [Word(arguments)]
    if origin is tuple:
        return [Several(kind) for kind in _kinds(arguments[0], unit, choices)]
    if hint is str and choices:
        return [Word(choices)]
    plain: dict[Any, Kind] = {float: Number(unit), int: Count(), bool: Switch(), type(None): Nothing()}
    return [plain[hint]] if hint in plain else []
