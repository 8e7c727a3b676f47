"""Rows of numbers in text at the speed of C: the quick way of the readers.

Whatever is unusual gives None, and the careful reader, which knows the line of every fault, reads the file instead:
nothing is accepted here that it would refuse, and errors are its own.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .decimals import BLANKS, DIGITS, Codes, Mask, decimals, has_plain_blanks
from .raw_mesh import Floats, Ints
from .short_numbers import short_numbers

PORTION = 1 << 20
"""Bytes that are looked at together: few enough for the cache and the memory, enough for little overhead."""
_SPACE, _NEWLINE = 32, 10
_INT = DIGITS + b"+-" + BLANKS
_MOST_DIGITS = 18  # more may not fit into 64 bits
_PLUS, _MINUS, _ZERO = b"+-0"


class Portion(NamedTuple):
    """Whole lines of a text.

    Attributes:
        codes: The bytes; the last is the end of a line.
        begins: First byte of each line.
        ends: The newline of each line.
        total: Bytes of the whole text.
    """

    codes: Codes
    begins: Ints
    ends: Ints
    total: int

    def lines(self, chosen: Mask) -> Portion:
        """Some of the lines."""
        if chosen.all():
            return self
        sizes = self.ends + 1 - self.begins
        ends = np.cumsum(sizes[chosen]) - 1
        begins = np.append(0, ends[:-1] + 1)[: ends.size]
        return Portion(self.codes[np.repeat(chosen, sizes)], begins, ends, self.total)


def is_usual(data: bytes) -> bool:
    """Whether bytes are text in lines that end with a newline, maybe after a carriage return."""
    return b"\0" not in data and (b"\r" not in data or data.count(b"\r") == data.count(b"\r\n"))


def portions(data: bytes, start: int = 0) -> Iterator[Portion]:
    """All lines of ``data`` from the byte ``start`` on, some at a time; a last one without an end is given one."""
    total = len(data) - start
    np.empty(8 * min(PORTION, total), np.uint8)  # once that is freed, the C library keeps what portions give back
    while start < len(data):
        end = data.find(b"\n", min(start + PORTION, len(data)) - 1) + 1 or len(data)
        piece = data[start:end]
        codes = np.frombuffer(piece if piece.endswith(b"\n") else piece + b"\n", np.uint8)
        ends = np.flatnonzero(codes == _NEWLINE)
        yield Portion(codes, np.append(0, ends[:-1] + 1), ends, total)
        start = end


def float_rows(text: Portion) -> tuple[Floats, Ints] | None:
    """Numbers of a text, and how many stand on each line; None if a word is no plain decimal number."""
    starts, ends, sizes = _words(text)
    values = decimals(text.codes, starts, ends, text.total)
    return None if values is None else (values, sizes)


def int_rows(text: Portion) -> tuple[Ints, Ints] | None:
    """Whole numbers of a text, and how many stand on each line; None if a word is none, or has many digits."""
    starts, ends, sizes = _words(text)
    values = short_numbers(text.codes, starts, ends) if has_plain_blanks(text.codes) else None
    if values is None:
        values = _long_numbers(text, starts)
    return None if values is None else (values, sizes)


def _words(text: Portion) -> tuple[Ints, Ints, Ints]:
    """First byte of each word, the blank behind it, and number of words on each line."""
    ends = np.flatnonzero(text.codes <= _SPACE)
    starts = np.empty_like(ends)
    starts[:1], starts[1:] = 0, ends[:-1]
    starts[1:] += 1
    filled = starts < ends
    if not filled.all():  # some blanks stand behind others
        starts, ends = starts[filled], ends[filled]
    rows = text.begins.size
    if rows and starts.size and starts.size % rows == 0:
        firsts, lasts = starts.reshape(rows, -1)[:, 0], ends.reshape(rows, -1)[:, -1]
        if (firsts >= text.begins).all() and (lasts <= text.ends).all():  # the usual case: as many on every line
            return starts, ends, np.full(rows, starts.size // rows)
    return starts, ends, np.diff(np.searchsorted(starts, text.ends), prepend=0)


def _long_numbers(text: Portion, starts: Ints) -> Ints | None:
    """Whole numbers that may have signs and up to 18 digits; None if there is anything else."""
    if starts.size and np.diff(starts, append=text.codes.size).max() > _MOST_DIGITS:
        return None  # blanks between words count, too: such a text is unusual enough
    signs = np.flatnonzero((text.codes == _MINUS) | (text.codes == _PLUS))
    if (text.codes[signs + 1] < _ZERO).any():  # a newline is behind the last one
        return None  # numpy reads a lone sign as a zero
    values = _whole_numbers(text.codes.tobytes()) if starts.size else np.zeros(0, np.int64)
    return None if values is None or values.size != starts.size else values


def _whole_numbers(data: bytes) -> Ints | None:
    """The whole numbers of a text; None if there is anything else in it.

    A word such as ``1-2`` gives two: those who call compare how many there are.
    """
    if data.translate(None, _INT):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # given where the text ends early
            values: Ints = np.fromstring(data, np.int64, sep=" ")
            return values
    except ValueError:
        return None


def without_word(text: Portion) -> Portion:
    """Lines without their first byte, a word of one letter."""
    codes = text.codes.copy()
    codes[text.begins] = _SPACE
    return text._replace(codes=codes)


class Parted(NamedTuple):
    """Words such as 1/2/3 apart.

    Attributes:
        text: With blanks for slashes.
        parts: How many numbers each word has.
        second: Whether the second of them stood behind the first slash.
        total: How many numbers there are if none is missing, 0 where no word is parted.
    """

    text: Portion
    parts: int
    second: bool
    total: int


def split_at_slashes(text: Portion) -> Parted | None:
    """Words apart that all have the form ``1``, all ``1/2``, all ``1//3`` or all ``1/2/3``; None otherwise."""
    slashes = np.flatnonzero(text.codes == ord("/"))
    if not slashes.size:
        return Parted(text, 1, False, 0)
    starts, _, _ = _words(text)
    each = slashes.size // max(starts.size, 1)
    if each not in (1, 2) or slashes.size != each * starts.size:
        return None
    table = slashes.reshape(-1, each)
    if (table[:, 0] < starts).any() or (table[:-1, -1] > starts[1:]).any():
        return None
    doubled = int((table[:, -1] - table[:, 0] == 1).sum())
    if doubled not in (0, len(table)):
        return None
    codes = text.codes.copy()
    codes[slashes] = _SPACE
    parts = 2 if doubled else each + 1
    return Parted(text._replace(codes=codes), parts, not doubled, parts * starts.size)
