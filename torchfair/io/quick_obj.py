"""The statements of an OBJ file at the speed of C, where ``v`` and ``f`` are written as nearly all files write them."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from .decimals import Mask
from .obj_attributes import CornerTextures
from .quick_rows import Portion, float_rows, int_rows, is_usual, portions, split_at_slashes, without_word
from .raw_mesh import Floats, Ints
from .text import Words

_V, _F, _SPACE = ord("v"), ord("f"), ord(" ")
_CONTINUED = re.compile(rb"\\[ \t]*([\r\n#]|\Z)")  # a comment behind changes nothing
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class QuickObj(NamedTuple):
    """What stands in a file.

    Attributes:
        points: (V, 3) of ``v`` statements.
        vertex_lines: (V,) their lines.
        corners: (H,) vertex numbers as they are written.
        textures: (H,) numbers of texture coordinates as they are written, 0 where there are none.
        sizes: (F,) corners of each face.
        face_lines: (F,) lines of ``f`` statements.
        normals: Number of ``vn`` statements, which nothing is read of.
        rest: All other lines, as text.
        rest_lines: Their numbers.
    """

    points: Floats
    vertex_lines: Ints
    corners: Ints
    textures: Ints
    sizes: Ints
    face_lines: Ints
    normals: int
    rest: bytes
    rest_lines: Ints

    def in_file(self, rest: Words) -> Words:
        """The words of the rest with the lines of the file."""
        return rest._replace(lines=self.rest_lines[rest.lines - 1])

    def corner_textures(self) -> CornerTextures:
        """Texture coordinates of the corners that have some."""
        corners = np.flatnonzero(self.textures)
        lines = np.repeat(self.face_lines, self.sizes)[corners]
        return CornerTextures(self.textures[corners], corners, lines)


def quick_statements(data: bytes) -> QuickObj | None:
    """The statements of a file; None if there are none or one is unusual, as a vertex of more than three numbers."""
    data = data.removeprefix(_BYTE_ORDER_MARK)
    if not data or not is_usual(data) or b"\x1a" in data or (b"\\" in data and _CONTINUED.search(data)):
        return None
    pieces, first_line = [], 1
    for text in portions(data):
        piece = _statements(text, first_line)
        if piece is None:
            return None
        pieces.append(piece)
        first_line += text.ends.size
    columns = list(zip(*pieces, strict=True))
    points, vertex_lines, corners, textures, sizes, face_lines = (np.concatenate(c) for c in columns[:6])
    rest = b"".join(columns[7])
    if rest.startswith(_BYTE_ORDER_MARK):  # one within the file, which would pass for one at its beginning
        return None
    return QuickObj(points, vertex_lines, corners, textures, sizes, face_lines, sum(columns[6]), rest,
        np.concatenate(columns[8]))  # fmt: skip


def _statements(text: Portion, first_line: int) -> QuickObj | None:
    """Those of a portion whose first line has that number."""
    codes, begins = text.codes, text.begins
    first, second, third = (codes[np.minimum(begins + place, text.ends)] for place in range(3))
    is_vertex, is_face = (first == _V) & (second == _SPACE), (first == _F) & (second == _SPACE)
    is_normal = (first == _V) & (second == ord("n")) & (third == _SPACE)
    is_rest = ~(is_vertex | is_face | is_normal)
    points, faces = _points(text, is_vertex), _faces(text, is_face)
    if points is None or faces is None:
        return None
    numbers = np.arange(first_line, first_line + begins.size)
    rest = text.lines(is_rest).codes.tobytes() if is_rest.any() else b""
    return QuickObj(points, numbers[is_vertex], *faces, numbers[is_face], int(is_normal.sum()), rest, numbers[is_rest])


def _points(text: Portion, chosen: Mask) -> Floats | None:
    if not chosen.any():
        return np.zeros((0, 3))
    rows = float_rows(without_word(text.lines(chosen)))
    return None if rows is None or (rows[1] != 3).any() else rows[0].reshape(-1, 3)


def _faces(text: Portion, chosen: Mask) -> tuple[Ints, Ints, Ints] | None:
    """Corners, texture coordinates and sizes of the faces."""
    none = np.zeros(0, np.int64)
    if not chosen.any():
        return none, none, none
    parted = split_at_slashes(without_word(text.lines(chosen)))
    rows = None if parted is None else int_rows(parted.text)
    if parted is None or rows is None or parted.total not in (0, rows[0].size):
        return None
    numbers = rows[0].reshape(-1, parted.parts)
    textures = numbers[:, 1] if parted.second else np.zeros(len(numbers), np.int64)
    if (numbers[:, 0] == 0).any() or (parted.second and (textures == 0).any()):
        return None
    return np.ascontiguousarray(numbers[:, 0]), textures, rows[1] // parted.parts
