"""Coloured words below pictures, in one size of type through the whole page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .sheet import CAPTION, Sheet

_SIZE = 22.0
_DARKER = 0.72  # of the colour, so that words in it can be read on white


class Entry(NamedTuple):
    """One colour.

    Attributes:
        words: What it stands for.
        color: Red, green and blue, 0 to 1.
    """

    words: str
    color: tuple[float, float, float]


def draw_legends(sheet: Sheet, legends: Sequence[Sequence[Entry]], lefts: Sequence[int], top: int, width: int) -> None:
    """One legend below each of some panels of a width, all in the size that the longest one allows."""
    rooms = [max(1, sum(len(entry.words) + 5 for entry in legend)) for legend in legends]
    size = min(_SIZE, 1.6 * width / max(rooms))
    for legend, left, room in zip(legends, lefts, rooms, strict=True):
        x = float(left)
        for words, color in legend:
            red, green, blue = (round(255 * _DARKER * part) for part in color)
            share = width * (len(words) + 5) / room
            style = {"ha": "center", "va": "center"}
            text = f"\N{BLACK SQUARE} {words}"
            sheet.text(text, x + share / 2, top + CAPTION / 2, size, f"#{red:02x}{green:02x}{blue:02x}", **style)
            x += share
