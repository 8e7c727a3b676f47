"""The body of a PLY file in text at the speed of C, where every row is a line and faces are one list each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .gathered import Gathered
from .ply_header import Element, Header
from .ply_rows import Column
from .quick_rows import Portion, float_rows, int_rows, is_usual, portions
from .raw_mesh import Floats, Ints

_NO_SIZES = np.zeros(0, np.int64)


def quick_body(
    data: bytes, header: Header, wanted: Mapping[str, Sequence[int]]
) -> tuple[dict[str, list[Column]], dict[str, Ints]] | None:
    """Columns of the ``wanted`` properties and lines of the rows of every element; None if any of it is unusual.

    Unusual are elements without rows, blank lines, more or fewer lines than the header promises, lists beside other
    properties, and numbers that are no plain decimal ones.
    """
    elements = header.elements
    if not is_usual(data) or not all(0 < element.count < len(data) and element.properties for element in elements):
        return None
    parts = {element.name: (Gathered(), Gathered()) for element in elements}
    place, done = 0, 0  # element, and its rows so far
    for text in portions(data, header.body_start):
        begin = 0
        while begin < text.ends.size:
            if place == len(elements):
                return None
            element = elements[place]
            end = min(begin + element.count - done, text.ends.size)
            rows = _rows(_between(text, begin, end), element, wanted.get(element.name, ()))
            if rows is None:
                return None
            for gathered, part in zip(parts[element.name], rows, strict=True):
                gathered.add(part, element.count * len(part) / (end - begin))
            done += end - begin
            begin = end
            if done == element.count:
                place, done = place + 1, 0
    if place < len(elements):
        return None
    columns = {
        element.name: _columns(element, parts[element.name][0].rows, parts[element.name][1].rows)
        for element in elements
    }
    return columns, _lines(header)


def _columns(element: Element, values: npt.NDArray[Any], sizes: Ints) -> list[Column]:
    if _is_plain(element):
        return [(column, np.broadcast_to(np.int64(1), len(column))) for column in values.T]
    return [(values, sizes)]


def _lines(header: Header) -> dict[str, Ints]:
    ends = np.cumsum([element.count for element in header.elements]).tolist()
    first = header.num_lines + 1
    return {
        element.name: np.arange(first + end - element.count, first + end)
        for element, end in zip(header.elements, ends, strict=True)
    }


def _between(text: Portion, first: int, last: int) -> Portion:
    start, end = int(text.begins[first]), int(text.ends[last - 1]) + 1
    return Portion(text.codes[start:end], text.begins[first:last] - start, text.ends[first:last] - start, text.total)


def _rows(text: Portion, element: Element, wanted: Sequence[int]) -> tuple[npt.NDArray[Any], Ints] | None:
    """The ``wanted`` values of some rows: (n, k) of numbers, or those of one list a row and their (n,) counts."""
    if _is_plain(element):
        return _plain_rows(text, element, wanted)
    return _lists(text) if len(element.properties) == 1 and list(wanted) == [0] else None


def _is_plain(element: Element) -> bool:
    return not any(item.count_type for item in element.properties)


def _plain_rows(text: Portion, element: Element, wanted: Sequence[int]) -> tuple[Floats, Ints] | None:
    """Rows without lists."""
    rows = float_rows(text)
    if rows is None or not all("f" in element.properties[i].type for i in wanted):
        return None
    values, sizes = rows
    if (sizes != len(element.properties)).any():
        return None
    return values.reshape(sizes.size, -1)[:, list(wanted)], _NO_SIZES


def _lists(text: Portion) -> tuple[Ints, Ints] | None:
    """Rows that are one list of whole numbers."""
    rows = int_rows(text)
    if rows is None or not rows[1].all():
        return None
    values, sizes = rows
    first = np.cumsum(sizes) - sizes
    if (values[first] != sizes - 1).any():
        return None
    if (sizes == sizes[0]).all():
        return values.reshape(sizes.size, -1)[:, 1:].reshape(-1), sizes - 1
    return np.delete(values, first), sizes - 1
