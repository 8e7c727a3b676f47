"""A field of a settings dataclass that has a unit, or words to choose from."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def setting(default: T, *, unit: str = "", choices: Sequence[str] = ()) -> T:
    """A dataclass field with its default and what its type does not say.

    Help, files and options of the command line are made from the field: its type (``Literal`` for words), its default,
    its entry under ``Attributes:`` in the docstring of the class, and these.

    Args:
        default: The default.
        unit: Such as ``"radians"`` (which people give in degrees), ``"mean edges"`` or ``"seconds"``.
        choices: Words that a field of type str may have, for people; objects are not concerned.

    Example::

        @dataclass(frozen=True)
        class Settings:
            smallest_angle: float = setting(math.radians(10.0), unit="radians")
    """
    made: T = dataclasses.field(default=default, metadata={"unit": unit, "choices": tuple(choices)})
    return made
