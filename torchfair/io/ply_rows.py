"""Bodies of PLY files: the rows of one element, as text or binary.

Both readers return a column for each wanted property: ``(values, sizes)``, where row ``i`` contributed
``sizes[i]`` values (1 for plain numbers, the length for lists).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .._ranges import ranges
from ..errors import MeshFileError
from .ply_header import Element
from .raw_mesh import Ints
from .text import Words, to_floats, to_ints

Numbers = npt.NDArray[Any]  # in the type of the file
Column = tuple[Numbers, Ints]
_STRUCT_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


def read_binary_rows(
    path: Path, data: bytes, start: int, element: Element, wanted: Sequence[int]
) -> tuple[list[Column], int]:
    """Columns of the ``wanted`` properties and the position behind the last row."""
    if not element.properties or not element.count:
        return [(np.zeros(0), np.zeros(0, np.int64)) for _ in wanted], start
    _, first_sizes, _ = _walk(path, data, start, element, 1)
    rows = _equal_rows(data, start, element, first_sizes[0])
    if rows is not None:
        sizes = [np.full(element.count, first_sizes[0, i]) for i in wanted]
        columns = [(rows[f"v{i}"].ravel(), s) for i, s in zip(wanted, sizes, strict=True)]
        return columns, start + rows.nbytes
    starts, all_sizes, end = _walk(path, data, start, element, element.count)
    buffer = np.frombuffer(data, np.uint8)
    types = [element.properties[i].type for i in wanted]
    parts = [_gather(buffer, starts[:, i], all_sizes[:, i], t) for i, t in zip(wanted, types, strict=True)]
    return [(values, all_sizes[:, i]) for i, values in zip(wanted, parts, strict=True)], end


def _equal_rows(data: bytes, start: int, element: Element, sizes: Ints) -> npt.NDArray[np.void] | None:
    """All rows at once if their lists have the lengths ``sizes`` of the first row; None otherwise."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for i, (item, size) in enumerate(zip(element.properties, sizes.tolist(), strict=True)):
        if item.count_type is not None:
            fields.append((f"n{i}", item.count_type, ()))
        fields.append((f"v{i}", item.type, (size,)))
    row_type = np.dtype(fields)
    if row_type.itemsize * element.count > len(data) - start:
        return None
    rows = np.frombuffer(data, row_type, element.count, start)
    listed = [i for i, item in enumerate(element.properties) if item.count_type is not None]
    return rows if all((rows[f"n{i}"] == sizes[i]).all() for i in listed) else None


def _walk(path: Path, data: bytes, position: int, element: Element, num_rows: int) -> tuple[Ints, Ints, int]:
    """Start and length of every property of the first rows, (num_rows, P) each, and the position behind them."""
    plan = []
    for item in element.properties:
        order, count_type = (item.count_type or "")[:1], (item.count_type or "")[1:]
        count = struct.Struct(order + _STRUCT_CODES[count_type]) if count_type else None
        plan.append((count, np.dtype(item.type).itemsize))
    starts: list[int] = []
    sizes: list[int] = []
    try:
        for row in range(num_rows):
            for count, width in plan:
                size = 1
                if count is not None:
                    size = count.unpack_from(data, position)[0]
                    position += count.size
                if size < 0:
                    raise MeshFileError(path, f"{element.name} {row} has a list of negative length {size}")
                starts.append(position)
                sizes.append(size)
                position += size * width
            if position > len(data):
                raise struct.error
    except struct.error:
        fault = f"the file ends within {element.name} {row} of {element.count}; it is truncated or damaged"
        raise MeshFileError(path, fault) from None
    shape = (num_rows, len(plan))
    return np.asarray(starts, np.int64).reshape(shape), np.asarray(sizes, np.int64).reshape(shape), position


def _gather(buffer: npt.NDArray[np.uint8], starts: Ints, sizes: Ints, type_: str) -> Numbers:
    """Packed values of lists that begin at the bytes ``starts``."""
    width = np.dtype(type_).itemsize
    positions = ranges(starts, sizes * width)
    values: Numbers = buffer[positions].view(type_)
    return values


def read_text_rows(path: Path, text: Words, element: Element, wanted: Sequence[int]) -> list[Column]:
    """Columns of the ``wanted`` properties; every line of ``text`` is a row."""
    columns: dict[int, Column] = {}
    position, ends = text.starts[:-1], text.starts[1:]
    for i, item in enumerate(element.properties):
        _check_row_ends(path, text, element, position < ends)
        sizes = np.ones_like(position)
        if item.count_type is not None:
            sizes = to_ints(path, text, position)
            position = position + 1
            _check_row_ends(path, text, element, (sizes >= 0) & (sizes <= ends - position))
        if i in wanted:
            convert = to_floats if "f" in item.type else to_ints
            columns[i] = convert(path, text, ranges(position, sizes)), sizes
        position = position + sizes
    _check_row_ends(path, text, element, position == ends)
    return [columns[i] for i in wanted]


def read_loose_rows(
    path: Path, text: Words, place: int, element: Element, wanted: Sequence[int]
) -> tuple[list[Column], Ints, int] | None:
    """Columns of the ``wanted`` properties, line of every row, and the word behind the last one.

    Rows may begin and end anywhere in a line. None if there are not enough words, or a length is no whole number.
    """
    starts: list[int] = []
    sizes: list[int] = []
    for _ in range(element.count if element.properties else 0):
        for item in element.properties:
            size = 1
            if item.count_type is not None:
                if place >= len(text.words) or not text.words[place].isdigit() or len(text.words[place]) > 18:
                    return None
                size = int(text.words[place])
                place += 1
            starts.append(place)
            sizes.append(size)
            place += size
        if place > len(text.words):
            return None
    shape = (-1, max(len(element.properties), 1))
    at, counts = np.asarray(starts, np.int64).reshape(shape), np.asarray(sizes, np.int64).reshape(shape)
    columns = []
    for i in wanted:
        convert = to_floats if "f" in element.properties[i].type else to_ints
        columns.append((convert(path, text, ranges(at[:, i], counts[:, i])), counts[:, i]))
    first = at[:, 0] - (1 if element.properties and element.properties[0].count_type is not None else 0)
    lines = text.lines[np.searchsorted(text.starts, first, side="right") - 1]
    return columns, lines, place


def _check_row_ends(path: Path, text: Words, element: Element, good: npt.NDArray[np.bool_]) -> None:
    wrong = np.flatnonzero(~good)
    if wrong.size:
        fault = f"{text.sizes[wrong[0]]} number(s) do not fit the properties of element '{element.name}'"
        raise MeshFileError(path, fault, int(text.lines[wrong[0]]))
