"""Text of DXF files: pairs of lines, a group code and a value, and the entities that they make up."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import MeshFileError
from .raw_mesh import Floats, Ints

_BINARY = b"AutoCAD Binary DXF"
_CODE = re.compile(r"[+-]?\d{1,4}")


class Tags(NamedTuple):
    """Group codes and values from a certain line on."""

    codes: Ints
    values: list[str]
    first: int = 0  # number of the first pair in the file

    @property
    def kind(self) -> str:
        """Of an entity: its name, such as MESH."""
        return self.values[0].strip()

    def line(self, row: int) -> int:
        """The line of the value of a pair."""
        return 2 * (self.first + row) + 2

    def value(self, code: int, default: str = "") -> str:
        """The first value with a group code."""
        rows = np.flatnonzero(self.codes == code)
        return self.values[rows[0]].strip() if rows.size else default

    def part(self, start: int, end: int) -> Tags:
        """Pairs ``start`` to ``end``."""
        return Tags(self.codes[start:end], self.values[start:end], self.first + start)


def tags_of(path: Path, data: bytes) -> Tags:
    """All pairs of a file.

    Raises:
        MeshFileError: it is binary, or a group code is no number.
    """
    if data.startswith(_BINARY):
        raise MeshFileError(path, "is a binary DXF file. Save it as text (ASCII DXF)")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:  # before AutoCAD 2007; all but names is ASCII
        text = data.decode("cp1252", "replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip().split("\n")
    words, values = lines[0::2], lines[1::2]
    values += [""] * (len(words) - len(values))
    try:
        codes = np.array(list(map(int, words)), np.int16)
    except (ValueError, OverflowError):
        row = next(row for row, word in enumerate(words) if not _CODE.fullmatch(word.strip()))
        fault = f"{words[row].strip()[:20]!r} is no group code, such as begins every pair of lines of a DXF file"
        raise MeshFileError(path, fault, 2 * row + 1) from None
    return Tags(codes.astype(np.int64), values)


def entities(tags: Tags, section: str) -> Iterator[Tags]:
    """Entities of a section, each from its name on."""
    starts = np.append(np.flatnonzero(tags.codes == 0), len(tags.codes)).tolist()
    inside = False
    for start, end in itertools.pairwise(starts):
        kind = tags.values[start].strip()
        if kind == "SECTION":
            inside = tags.part(start, end).value(2) == section
        elif kind == "ENDSEC":
            inside = False
        elif inside:
            yield tags.part(start, end)


def header_value(tags: Tags, name: str, default: str) -> str:
    """A variable of the header, such as $INSUNITS."""
    for row in np.flatnonzero(tags.codes[:-1] == 9).tolist():
        if tags.values[row].strip() == name:
            return tags.values[row + 1].strip()
    return default


def count_of(path: Path, tags: Tags, row: int) -> int:
    """A number of things behind, of which there cannot be more than lines."""
    (value,) = integers_of(path, tags, np.array([row]))
    if not 0 <= value <= len(tags.codes):
        raise MeshFileError(path, f"{value} is more than the file holds", tags.line(row))
    return int(value)


def integer_of(path: Path, tags: Tags, code: int) -> int:
    """The first value of a group as a number, 0 without."""
    rows = np.flatnonzero(tags.codes == code)[:1]
    return int(integers_of(path, tags, rows)[0]) if rows.size else 0


def integers_of(path: Path, tags: Tags, rows: Ints) -> Ints:
    """Values of some pairs as whole numbers."""
    words = [tags.values[row] for row in rows.tolist()]
    try:
        return np.array(list(map(int, words)), np.int64)
    except (ValueError, OverflowError):
        raise _no_number(path, tags, rows, int) from None


def floats_of(path: Path, tags: Tags, rows: Ints) -> Floats:
    """Values of some pairs as numbers."""
    words = [tags.values[row] for row in rows.tolist()]
    try:
        return np.array(list(map(float, words)), np.float64)
    except ValueError:
        raise _no_number(path, tags, rows, float) from None


def _no_number(path: Path, tags: Tags, rows: Ints, kind: type) -> MeshFileError:
    for row in rows.tolist():
        try:
            np.int64(int(tags.values[row])) if kind is int else float(tags.values[row])
        except (ValueError, OverflowError):
            break
    what = "whole number" if kind is int else "number"
    return MeshFileError(path, f"{tags.values[row].strip()[:20]!r} is no {what}", tags.line(row))
