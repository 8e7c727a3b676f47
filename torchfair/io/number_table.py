"""Tables of numbers in text files, with one rule for commas."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import MeshFileError
from .raw_mesh import Floats
from .text import Words, check_text, quote, split_words, to_floats

_INNER = re.compile(rb"[^,]+,[^,]+")
_DECIMAL = re.compile(rb"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")
_RULE = (
    "it is not clear whether its comma is a decimal mark: it is one where all numbers of the file are set apart by "
    "blanks, tabs or semicolons and none has a point. Write points, or separate all numbers by commas"
)


def read_table(path: Path, data: bytes, widths: Sequence[int]) -> Floats:
    """Rows of numbers, one a line, all of the same of some ``widths``.

    Numbers are set apart by blanks, tabs, semicolons or commas; # starts a comment, and a line of words before the
    numbers is passed over. What commas are is the same in the whole file. They are decimal marks (0,5;0,0;1,5 and
    0,5 0,0 1,5) if something else sets numbers apart and one comma stands inside of them, between digits. They set
    numbers apart otherwise (0.5,0.0,1.5 and 0.5, 0.0, 1.5). What could be either (0.5;0,5;1, 1.234,5;0;0) is refused.

    Raises:
        MeshFileError: naming file and line, if a line is no such row, or one of its numbers is not finite.
    """
    lines = [line.split(b"#", 1)[0].replace(b";", b" ") for line in check_text(path, data).splitlines()]
    head = next((number for number, line in enumerate(lines) if line.split()), 0)
    if lines and _is_heading(lines[head]):
        lines[head] = b""
    text = split_words(b"\n".join(lines))
    inside = _inner_comma(text)
    if inside is None:
        return _rows(path, split_words(b"\n".join(lines).replace(b",", b" ")), widths)
    if not all(map(_DECIMAL.fullmatch, text.words)):
        raise MeshFileError(path, f"{quote(text.words[inside])}: {_RULE}", text.line_of(inside))
    return _rows(path, text._replace(words=[word.replace(b",", b".") for word in text.words]), widths)


def _rows(path: Path, text: Words, widths: Sequence[int]) -> Floats:
    sizes = text.sizes
    if not sizes.size:
        raise MeshFileError(path, "holds no numbers")
    width = int(sizes[0]) if sizes[0] in widths else widths[0]
    wrong = np.flatnonzero(sizes != width)
    if wrong.size:
        wanted = " or ".join(map(_COUNTS.__getitem__, widths))
        fault = f"expected {wanted} numbers in every line, found {sizes[wrong[0]]}"
        raise MeshFileError(path, fault, int(text.lines[wrong[0]]))
    rows = to_floats(path, text, np.arange(len(text.words))).reshape(-1, width)
    lost = np.flatnonzero(~np.isfinite(rows).all(1))
    if lost.size:
        row = ", ".join(map(str, rows[lost[0]].tolist()))
        raise MeshFileError(path, f"expected finite numbers, got {row}", int(text.lines[lost[0]]))
    return rows


_COUNTS = {3: "three", 6: "six"}


def _inner_comma(text: Words) -> int | None:
    """Position of a word with one comma inside, on a line of several words; None if there is none."""
    several = np.repeat(text.sizes > 1, text.sizes).tolist()
    words = enumerate(zip(text.words, several, strict=True))
    return next((place for place, (word, among) in words if among and _INNER.fullmatch(word)), None)


def _is_heading(line: bytes) -> bool:
    words = line.replace(b",", b" ").split()
    try:
        float(words[0] if words else b"0")
    except ValueError:
        return True
    return False
