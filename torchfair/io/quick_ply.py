"""The body of a PLY file in text at the speed of C, where every row is a line and faces are one list each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .ply_header import Element, Header
from .ply_rows import Column
from .quick_rows import Portion, float_rows, int_rows, is_usual, portions
from .raw_mesh import Ints


def quick_body(
    data: bytes, header: Header, wanted: Mapping[str, Sequence[int]]
) -> tuple[dict[str, list[Column]], dict[str, Ints]] | None:
    """Columns of the ``wanted`` properties and lines of the rows of every element; None if any of it is unusual.

    Unusual are elements without rows, blank lines, more or fewer lines than the header promises, lists beside other
    properties, and numbers that are no plain decimal ones.
    """
    names = {element.name for element in header.elements if element.count and element.properties}
    if not is_usual(data) or len(names) < len(header.elements):
        return None
    elements = header.elements
    parts: dict[str, list[list[Column]]] = {element.name: [] for element in header.elements}
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
            parts[element.name].append(rows)
            done += end - begin
            begin = end
            if done == element.count:
                place, done = place + 1, 0
    if place < len(elements):
        return None
    return {name: _joined(rows) for name, rows in parts.items()}, _lines(header)


def _lines(header: Header) -> dict[str, Ints]:
    ends = np.cumsum([element.count for element in header.elements]).tolist()
    first = header.num_lines + 1
    return {
        element.name: np.arange(first + end - element.count, first + end)
        for element, end in zip(header.elements, ends, strict=True)
    }


def _joined(rows: list[list[Column]]) -> list[Column]:
    """Columns of an element of the rows of several portions."""
    columns = [zip(*column, strict=True) for column in zip(*rows, strict=True)]
    return [(np.concatenate(next(column)), np.concatenate(next(column))) for column in columns]


def _between(text: Portion, first: int, last: int) -> Portion:
    start, end = int(text.begins[first]), int(text.ends[last - 1]) + 1
    return Portion(text.codes[start:end], text.begins[first:last] - start, text.ends[first:last] - start)


def _rows(text: Portion, element: Element, wanted: Sequence[int]) -> list[Column] | None:
    properties = element.properties
    if not any(item.count_type for item in properties):
        return _plain_rows(text, element, wanted)
    return _lists(text) if len(properties) == 1 and list(wanted) == [0] else None


def _plain_rows(text: Portion, element: Element, wanted: Sequence[int]) -> list[Column] | None:
    """Rows without lists."""
    rows = float_rows(text)
    if rows is None or not all("f" in element.properties[i].type for i in wanted):
        return None
    values, sizes = rows
    if (sizes != len(element.properties)).any():
        return None
    table = values.reshape(sizes.size, -1)
    return [(table[:, i], np.ones_like(sizes)) for i in wanted]


def _lists(text: Portion) -> list[Column] | None:
    """Rows that are one list of whole numbers."""
    rows = int_rows(text)
    if rows is None or not rows[1].all():
        return None
    values, sizes = rows
    first = np.cumsum(sizes) - sizes
    if (values[first] != sizes - 1).any():
        return None
    return [(np.delete(values, first), sizes - 1)]
