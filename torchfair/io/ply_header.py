"""Headers of PLY files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..errors import MeshFileError
from .text import quote

# names of the format and the common aliases -> numpy type without byte order
_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
    "int64": "i8",
    "uint64": "u8",
    "longlong": "i8",
    "ulonglong": "u8",
}
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Property:
    """A number, or a list with its length in front, that every row of an element has."""

    name: str
    type: str  # numpy type with byte order, such as "<f8"
    count_type: str | None = None  # of lists


@dataclass
class Element:
    """A table of the file."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    def find(self, *names: str) -> int | None:
        """Position of the first property with one of ``names``."""
        return next((i for i, p in enumerate(self.properties) if p.name in names), None)


@dataclass(frozen=True)
class Header:
    """What a PLY file says about its body."""

    byte_order: str  # "" for text, else "<" or ">"
    elements: list[Element]
    body_start: int  # first byte behind the header
    num_lines: int


def read_header(path: Path, data: bytes) -> Header:
    """The header of a PLY file.

    Raises:
        MeshFileError: with the line of the fault.
    """
    line_end = b"\r\n" if data[3:5] == b"\r\n" else data[3:4]
    if data[:3] != b"ply" or line_end not in (b"\n", b"\r", b"\r\n"):
        raise MeshFileError(path, f"expected 'ply' alone on the first line, got {quote(data[:12])}", 1)
    byte_order: str | None = None
    elements: list[Element] = []
    position, number = 3 + len(line_end), 1
    while True:
        end = data.find(line_end, position)
        number += 1
        if end < 0:
            raise MeshFileError(path, "the header has no end_header line; the file is truncated or damaged", number)
        words = data[position:end].decode("ascii", "replace").split()
        position = end + len(line_end)
        if words == ["end_header"]:
            break
        try:
            if words[:1] == ["format"] and byte_order is None:
                byte_order = _read_format(words)
            else:
                _read_statement(words, byte_order, elements)
        except ValueError as error:
            raise MeshFileError(path, str(error), number) from None
    if byte_order is None:
        raise MeshFileError(path, "the header has no format line", number)
    return Header(byte_order, elements, position, number)


def _read_format(words: list[str]) -> str:
    if len(words) != 3 or words[1] not in _BYTE_ORDERS or words[2] != "1.0":
        raise ValueError(f"expected 'format {'|'.join(_BYTE_ORDERS)} 1.0', got {_shown(words)}")
    return _BYTE_ORDERS[words[1]]


def _read_statement(words: list[str], byte_order: str | None, elements: list[Element]) -> None:
    if not words or words[0] in ("comment", "obj_info"):
        return
    if byte_order is None:
        raise ValueError(f"expected the format line, got {_shown(words)}")
    if not "".join(words).isprintable():  # names appear in messages
        raise ValueError(f"{_shown(words)} is no text")
    if words[0] == "element" and len(words) == 3 and words[2].isdecimal() and len(words[2]) < 19:
        if any(element.name == words[1] for element in elements):
            raise ValueError(f"a second element {_shown(words[1:2])}")
        elements.append(Element(words[1], int(words[2])))
    elif words[0] == "property" and elements:
        elements[-1].properties.append(_read_property(words, byte_order))
    else:
        raise ValueError(f"{_shown(words)} is no statement of a PLY header")


def _read_property(words: list[str], byte_order: str) -> Property:
    if len(words) == 3 and words[1] in _TYPES:
        return Property(words[2], byte_order + _TYPES[words[1]])
    if len(words) == 5 and words[1] == "list" and words[2] in _TYPES and words[3] in _TYPES:
        count_type = _TYPES[words[2]]
        if not count_type.startswith("f"):
            return Property(words[4], byte_order + _TYPES[words[3]], byte_order + count_type)
    raise ValueError(f"{_shown(words)} is no property with known types")


def _shown(words: list[str]) -> str:
    return quote(" ".join(words).encode())
