"""Patterns of vertex stars in words."""

from __future__ import annotations

from collections.abc import Sequence

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def pattern_words(pattern: Sequence[int], valence: int | None = None) -> str:
    """A pattern of a star (:meth:`~torchfair.stars.StarClasses.pattern`) in words.

    ``(2, 2, 1, 1)`` is "two up, two down, one up, one down". A pattern does not depend on sides: up and down may be
    the other way round. Edges in the plane are counted if the valence is given. Where all edges are on one side it is
    "all six on one side", without a plane "no plane".
    """
    if not pattern:
        return "no plane"
    inside = 0 if valence is None else valence - sum(pattern)
    words = [_number(count) for count in pattern]
    if len(words) == 1:
        words = [f"all {words[0]} on one side" if not inside else f"{words[0]} on one side"]
    else:
        words = [f"{word} {('up', 'down')[number % 2]}" for number, word in enumerate(words)]
    return ", ".join([*words, *([f"{_number(inside)} in the plane"] if inside else [])])


def _number(count: int) -> str:
    return _NUMBERS[count] if count < len(_NUMBERS) else str(count)
