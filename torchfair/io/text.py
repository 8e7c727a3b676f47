"""Reads numbers in text files in bulk, and still knows the line of every fault."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import MeshFileError
from .raw_mesh import Floats, Ints

_INT64 = range(-(2**63), 2**63)


def check_text(path: Path, data: bytes) -> bytes:
    """``data`` without a UTF-8 byte order mark; refuses UTF-16 and binary content."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise MeshFileError(path, "is encoded in UTF-16. Save it as ASCII or UTF-8")
    nul = data.find(b"\0")
    if nul >= 0:
        raise MeshFileError(path, "holds binary data where text is expected", line_of_byte(data, nul))
    return data.removeprefix(b"\xef\xbb\xbf")


def line_of_byte(data: bytes, position: int) -> int:
    """Line number, counted from 1, of the byte at ``position``."""
    return len((data[:position] + b"x").splitlines())


def quote(word: bytes) -> str:
    """A word of a file as it can be shown in a message."""
    shown = ascii(word[:24].decode("utf-8", "replace"))
    return shown if len(word) <= 24 else f"{shown}..."


class Words(NamedTuple):
    """The words of a text file, line by line; lines without words are left out.

    The words of line ``i`` are ``words[starts[i]:starts[i + 1]]``, and its number in the file is ``lines[i]``.
    """

    words: list[bytes]
    starts: Ints  # (L+1,)
    lines: Ints  # (L,)

    @property
    def sizes(self) -> Ints:
        """(L,) number of words in each line."""
        return np.diff(self.starts)

    def between(self, first: int, last: int) -> Words:
        """The lines ``first..last-1``; their words keep their positions."""
        return Words(self.words, self.starts[first : last + 1], self.lines[first:last])

    def line_of(self, position: int) -> int:
        """Number in the file of the line that holds a word."""
        return int(self.lines[np.searchsorted(self.starts, position, side="right") - 1])


def first_words(text: Words) -> list[bytes]:
    """First word of every line."""
    return [text.words[start] for start in text.starts[:-1].tolist()]


def split_words(data: bytes, first_line: int = 1) -> Words:
    """Words and lines of ``data`` as Python's ``split`` and ``splitlines`` find them, without a loop."""
    codes = np.frombuffer(data, np.uint8)
    is_line_end = codes == 10
    is_line_end[:-1] |= (codes[:-1] == 13) & ~is_line_end[1:]
    is_line_end[-1:] |= codes[-1:] == 13
    line_ends = np.flatnonzero(is_line_end)
    blank = (codes == 32) | (codes - np.uint8(9) < 5)  # space, or tab to carriage return; below 9 wraps round
    is_word_start = ~blank
    is_word_start[1:] &= blank[:-1]
    word_starts = np.flatnonzero(is_word_start)
    starts = np.concatenate([[0], np.searchsorted(word_starts, line_ends), [word_starts.size]])
    filled = np.flatnonzero(np.diff(starts))
    return Words(data.split(), np.append(starts[filled], word_starts.size), filled + first_line)


def to_floats(path: Path, text: Words, positions: Ints) -> Floats:
    """The words at ``positions`` as numbers."""
    words = [text.words[i] for i in positions.tolist()]
    try:
        values = np.fromiter(map(float, words), np.float64, len(words))
        faulty = b"_" in b" ".join(words)  # Python reads 1_000 as a number, file formats do not
    except ValueError:
        faulty = True
    if faulty:
        _blame(path, text, positions, _to_float, "a number")
    return values


def to_ints(path: Path, text: Words, positions: Ints) -> Ints:
    """The words at ``positions`` as whole numbers."""
    words = [text.words[i] for i in positions.tolist()]
    try:
        values = np.fromiter(map(int, words), np.int64, len(words))
        faulty = b"_" in b" ".join(words)
    except (ValueError, OverflowError):
        faulty = True
    if faulty:
        _blame(path, text, positions, _to_int, "a whole number of reasonable size")
    return values


def _to_float(word: bytes) -> float:
    if b"_" in word:
        raise ValueError
    return float(word)


def _to_int(word: bytes) -> int:
    if b"_" in word or int(word) not in _INT64:
        raise ValueError
    return int(word)


def _blame(path: Path, text: Words, positions: Ints, convert: Callable[[bytes], object], wanted: str) -> None:
    """Raises an error that names the first word that cannot be converted, and its line."""
    for position in positions.tolist():
        try:
            convert(text.words[position])
        except ValueError:
            fault = f"expected {wanted}, got {quote(text.words[position])}"
            raise MeshFileError(path, fault, text.line_of(position)) from None
