"""Object File Format (OFF): vertices and polygons as text.

The first word is ``OFF`` (it may be left out), with ``C`` (colours), ``N`` (normals) and ``ST`` (texture coordinates)
in front where vertices carry more than ``x y z``; these are skipped, and so are colours behind faces. The counts may
stand on the same line. Numbers may be spread over lines in any way, as long as nothing follows the corners of faces.
``4OFF`` and ``nOFF`` (other dimensions) and ``OFF BINARY`` are refused.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .._ranges import ranges
from ..errors import MeshFileError
from .raw_mesh import Floats, Ints, Origin, RawMesh, assemble
from .text import Words, check_text, quote, split_words, to_floats, to_ints
from .text_rows import face_lines, vertex_lines

_HEADER = re.compile(rb"(ST)?C?N?OFF")
_COLOUR_SIZES = (0, 1, 3, 4)  # behind a face: none, index into a map, rgb, rgba


def read_off(path: Path, data: bytes) -> RawMesh:
    """Polygon mesh of an OFF file.

    Raises:
        MeshFileError: with the line of the fault.
    """
    data = check_text(path, data)
    text = split_words(re.sub(rb"#[^\r\n]*", b"", data) if b"#" in data else data)
    try:
        return _read_lines(path, text)
    except MeshFileError:
        mesh = _read_free(path, text)
        if mesh is None:
            raise
        return mesh


def _read_lines(path: Path, text: Words) -> RawMesh:
    """The mesh of a file with a line for every vertex and face."""
    num_vertices, num_faces, header_rows = _read_header(path, text)
    end = header_rows + num_vertices + num_faces
    if len(text.lines) != end:
        found = len(text.lines) - header_rows
        fault = f"the header promises {num_vertices} vertices and {num_faces} faces, but {found} lines follow it"
        raise MeshFileError(path, fault, int(text.lines[min(end, len(text.lines) - 1)]))
    vertices = text.between(header_rows, header_rows + num_vertices)
    faces = text.between(header_rows + num_vertices, end)
    points = _read_vertices(path, vertices)
    corners, sizes = _read_faces(path, faces)
    return assemble(Origin(path, vertices.lines, faces.lines), points, corners, sizes)


def write_off(mesh: RawMesh) -> bytes:
    """The bytes of an OFF file."""
    header = f"OFF\n{len(mesh.points)} {len(mesh.offsets) - 1} 0\n"
    return (header + vertex_lines(mesh.points) + face_lines(mesh, with_size=True)).encode()


def _read_header(path: Path, text: Words) -> tuple[int, int, int]:
    """Numbers of vertices, faces, and lines of the header."""
    keyword = text.words[0] if text.words else b""
    named = not keyword.isdigit()
    if named and not _HEADER.fullmatch(keyword):
        kinds = "OFF, COFF, NOFF, CNOFF and the same after ST"
        raise MeshFileError(path, f"expected one of {kinds} as the first word, got {quote(keyword)}", 1)
    stands_alone = named and text.starts[1] == 1
    row = 1 if stands_alone and len(text.lines) > 1 else 0
    first, last = (int(named), text.starts[1]) if row == 0 else text.starts[1:3]
    if last - first not in (2, 3):
        found = quote(b" ".join(text.words[first:last]))
        raise MeshFileError(
            path, f"expected the numbers of vertices, faces and edges, got {found}", int(text.lines[row])
        )
    num_vertices, num_faces = to_ints(path, text, np.arange(first, last))[:2].tolist()
    if min(num_vertices, num_faces) < 0:
        fault = f"negative counts: {num_vertices} vertices, {num_faces} faces"
        raise MeshFileError(path, fault, int(text.lines[row]))
    return num_vertices, num_faces, row + 1


def _read_free(path: Path, text: Words) -> RawMesh | None:
    """The mesh of a file whose numbers stand on any lines; None if they do not add up."""
    words = text.words
    named = _HEADER.fullmatch(words[0]) if words else None
    begin = 1 if named else 0
    if len(words) < begin + 3 or not all(map(_is_count, words[begin : begin + 3])):
        return None
    num_vertices, num_faces = int(words[begin]), int(words[begin + 1])
    keyword = words[0] if named else b"OFF"
    colours = (4, 3) if b"C" in keyword else (0,)
    for extra in colours:
        columns = 3 + extra + 3 * (b"N" in keyword) + 2 * (b"ST" in keyword)
        first_face = begin + 3 + columns * num_vertices
        starts = _face_starts(words, first_face, num_faces)
        if starts is not None:
            vertices = begin + 3 + np.arange(columns * num_vertices)
            points = to_floats(path, text, vertices).reshape(-1, columns)[:, :3]
            sizes = to_ints(path, text, starts)
            lines = np.array([text.line_of(place) for place in (*vertices[::columns].tolist(), *starts.tolist())])
            origin = Origin(path, lines[:num_vertices], lines[num_vertices:])
            corners = to_ints(path, text, ranges(starts + 1, sizes))
            return assemble(origin, np.ascontiguousarray(points), corners, sizes)
    return None


def _is_count(word: bytes) -> bool:
    return word.isdigit() and len(word) < 19


def _face_starts(words: Sequence[bytes], place: int, count: int) -> Ints | None:
    """Where each face begins with its size; None unless they end with the words."""
    starts = []
    for _ in range(count):
        if place >= len(words) or not _is_count(words[place]):
            return None
        starts.append(place)
        place += 1 + int(words[place])
    return np.array(starts, np.int64) if place == len(words) else None


def _read_vertices(path: Path, text: Words) -> Floats:
    columns = int(text.sizes[0]) if text.lines.size else 3
    wrong = np.flatnonzero(text.sizes != max(columns, 3))
    if wrong.size:
        wanted = "at least 3" if columns < 3 else f"{columns}, as on the first one,"
        fault = f"expected {wanted} numbers in a vertex line, got {text.sizes[wrong[0]]}"
        raise MeshFileError(path, fault, int(text.lines[wrong[0]]))
    numbers = to_floats(path, text, np.arange(text.starts[0], text.starts[-1]))
    return np.ascontiguousarray(numbers.reshape(-1, columns)[:, :3])


def _read_faces(path: Path, text: Words) -> tuple[Ints, Ints]:
    first = text.starts[:-1]
    sizes = to_ints(path, text, first)
    colours = text.sizes - 1 - sizes  # words behind the corners
    wrong = np.flatnonzero((sizes < 0) | ~np.isin(colours, _COLOUR_SIZES))
    if wrong.size:
        fault = f"a face of {sizes[wrong[0]]} corners cannot have {text.sizes[wrong[0]] - 1} numbers"
        raise MeshFileError(path, fault, int(text.lines[wrong[0]]))
    to_floats(path, text, ranges(first + 1 + sizes, colours))  # not used, but must be numbers
    return to_ints(path, text, ranges(first + 1, sizes)), sizes
