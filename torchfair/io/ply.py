"""Stanford PLY, as text and in both binary byte orders: vertices and polygons.

Read are ``x, y, z`` of the element ``vertex`` and the list ``vertex_indices`` (or ``vertex_index``) of the
element ``face``, or of ``tristrips``; every other property and element is skipped, and a note names those, and what
follows the last element. Rows of text may be spread over lines in any way. Written are float64 positions.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._names import first_few
from ..errors import MeshFileError
from .ply_header import Element, Header, read_header
from .ply_rows import Column, read_binary_rows, read_loose_rows, read_text_rows
from .quick_ply import quick_body
from .raw_mesh import Ints, Origin, RawMesh, assemble
from .text import Words, check_text, split_words
from .text_rows import face_lines, vertex_lines

Bytes = npt.NDArray[np.uint8]

_STRIPS = "tristrips"
_COLORS = ("red", "green", "blue")


def read_ply(path: Path, data: bytes) -> RawMesh:
    """Polygon mesh of a PLY file.

    Raises:
        MeshFileError: with the line of the fault, where the file is text.
    """
    header = read_header(path, data)
    wanted = _wanted_properties(path, header)
    faces = "face" if "face" in wanted else _STRIPS
    if header.byte_order:
        columns, more = _read_binary(path, data, header, wanted)
        origin = Origin(path)
    else:
        columns, lines, more = _read_text(path, data, header, wanted)
        origin = Origin(path, lines["vertex"], lines[faces])
    points = np.stack([values for values, _ in columns["vertex"]], axis=1).astype(np.float64, copy=False)
    corners, sizes = columns[faces][0]
    corners = corners.astype(np.int64, copy=False)
    if faces == _STRIPS:
        corners, sizes, strips = _cut_strips(corners, sizes)
        if origin.face_lines is not None:
            origin = origin._replace(face_lines=origin.face_lines[strips])
    mesh = assemble(origin, points, corners, sizes)
    return mesh._replace(notes=(*more, *_skipped(header, wanted)))


def _skipped(header: Header, wanted: dict[str, list[int]]) -> list[str]:
    """A note that names what was not read, if anything."""
    names = []
    for element in header.elements:
        if element.count and element.name not in wanted:
            names.append(f"element {element.name}")
        elif element.count:
            taken = wanted[element.name]
            names += [f"{element.name} {item.name}" for i, item in enumerate(element.properties) if i not in taken]
    return [f"left out of the file: {first_few(names, len(names))}"] if names else []


def _cut_strips(numbers: Ints, sizes: Ints) -> tuple[Ints, Ints, Ints]:
    """Triangles of strips, which -1 sets apart: their corners, their sizes, and the row of each.

    Every other triangle of a strip is turned over; those that come twice to a vertex only lead on to the next one.
    """
    rows = np.repeat(np.arange(len(sizes)), sizes)
    first = np.arange(max(len(numbers) - 2, 0))
    whole = (
        (rows[first] == rows[first + 2]) & (numbers[first] >= 0) & (numbers[first + 1] >= 0) & (numbers[first + 2] >= 0)
    )
    begins = np.append(True, (rows[1:] != rows[:-1]) | (numbers[:-1] < 0))[: len(numbers)]
    start = np.maximum.accumulate(np.where(begins, np.arange(len(numbers)), 0))
    first = first[whole]
    odd = (first - start[first]) % 2
    a, b, c = numbers[first], numbers[first + 1 + odd], numbers[first + 2 - odd]
    proper = (a != b) & (b != c) & (c != a)
    corners = np.stack([a, b, c], axis=1)[proper]
    return corners.ravel(), np.full(len(corners), 3), rows[first][proper]


def _wanted_properties(path: Path, header: Header) -> dict[str, list[int]]:
    """Positions of the properties to read, for the elements ``vertex`` and ``face``."""
    elements = {element.name: element for element in header.elements}
    faces = _STRIPS if _STRIPS in elements and "face" not in elements else "face"
    for name in ("vertex", faces):
        if name not in elements:
            found = ", ".join(elements) or "none"
            raise MeshFileError(path, f"the header has no element '{name}' (elements: {found})", header.num_lines)
    coordinates = [_find(path, header, elements["vertex"], False, axis) for axis in "xyz"]
    corners = _find(path, header, elements[faces], True, "vertex_indices", "vertex_index")
    return {"vertex": coordinates, faces: [corners]}


def _find(path: Path, header: Header, element: Element, is_list: bool, *names: str) -> int:
    position = element.find(*names)
    if position is not None:
        found = element.properties[position]
        if (found.count_type is not None) == is_list and not (is_list and "f" in found.type):
            return position
    kind = "list of whole numbers" if is_list else "number"
    raise MeshFileError(path, f"element '{element.name}' has no {kind} '{names[0]}'", header.num_lines)


def _read_binary(
    path: Path, data: bytes, header: Header, wanted: dict[str, list[int]]
) -> tuple[dict[str, list[Column]], list[str]]:
    columns = {}
    position = header.body_start
    for element in header.elements:
        columns[element.name], position = read_binary_rows(path, data, position, element, wanted.get(element.name, []))
    return columns, [_more(f"{len(data) - position} byte(s)")] if data[position:].strip() else []


def _more(what: str) -> str:
    return f"{what} behind the last element that the header promises are not read"


def _read_text(
    path: Path, data: bytes, header: Header, wanted: dict[str, list[int]]
) -> tuple[dict[str, list[Column]], dict[str, Ints], list[str]]:
    """Columns, and line numbers of the rows, of every element; and a note if there is more."""
    quick = quick_body(data, header, wanted)
    if quick is not None:
        return *quick, []
    check_text(path, data)
    text = split_words(data[header.body_start :], header.num_lines + 1)
    try:
        return _read_lines(path, text, header, wanted)
    except MeshFileError:
        with contextlib.suppress(MeshFileError):
            loose = _read_loose(path, text, header, wanted)
            if loose is not None:
                return loose
        raise


def _read_loose(
    path: Path, text: Words, header: Header, wanted: dict[str, list[int]]
) -> tuple[dict[str, list[Column]], dict[str, Ints], list[str]] | None:
    """What :func:`_read_text` gives of a file whose rows are not lines; None if its numbers do not add up."""
    columns, lines, place = {}, {}, 0
    for element in header.elements:
        if element.count > len(text.words):
            return None
        found = read_loose_rows(path, text, place, element, wanted.get(element.name, []))
        if found is None:
            return None
        columns[element.name], lines[element.name], place = found
    return (columns, lines, []) if place == len(text.words) else None


def _read_lines(
    path: Path, text: Words, header: Header, wanted: dict[str, list[int]]
) -> tuple[dict[str, list[Column]], dict[str, Ints], list[str]]:
    columns, element_lines = {}, {}
    taken, available = 0, len(text.lines)
    for element in header.elements:
        end = taken + (element.count if element.properties else 0)
        if end > available:
            fault = f"the file ends within the {element.count} rows of element '{element.name}'"
            raise MeshFileError(path, fault, int(text.lines[-1]) if available else header.num_lines)
        rows = text.between(taken, end)
        element_lines[element.name] = rows.lines
        columns[element.name] = read_text_rows(path, rows, element, wanted.get(element.name, []))
        taken = end
    more = [_more(f"{available - taken} line(s), from line {text.lines[taken]} on,")] if taken < available else []
    return columns, element_lines, more


def write_ply(mesh: RawMesh, *, binary: bool = False, colors: Bytes | None = None) -> bytes:
    """The bytes of a PLY file, as text or in little-endian binary, with colours (V, 3) of vertices if there are any."""
    sizes = np.diff(mesh.offsets)
    count_type = "uchar" if sizes.max() < 256 else "int"
    header = [
        "ply",
        f"format {'binary_little_endian' if binary else 'ascii'} 1.0",
        f"element vertex {len(mesh.points)}",
        *(f"property double {axis}" for axis in "xyz"),
        *(f"property uchar {name}" for name in _COLORS if colors is not None),
        f"element face {len(sizes)}",
        f"property list {count_type} int vertex_indices",
        "end_header\n",
    ]
    text = "\n".join(header)
    if binary:
        count_width = 1 if count_type == "uchar" else 4
        return text.encode() + _binary_vertices(mesh, colors) + _binary_faces(mesh, sizes, count_width)
    vertices = vertex_lines(mesh.points)
    if colors is not None:
        rows = zip(vertices.splitlines(), colors.tolist(), strict=True)
        vertices = "".join(f"{row} {red} {green} {blue}\n" for row, (red, green, blue) in rows)
    return (text + vertices + face_lines(mesh, with_size=True)).encode()


def _binary_vertices(mesh: RawMesh, colors: Bytes | None) -> bytes:
    points = mesh.points.astype("<f8").view(np.uint8).reshape(len(mesh.points), -1)
    return points.tobytes() if colors is None else np.concatenate([points, colors], axis=1).tobytes()


def _binary_faces(mesh: RawMesh, sizes: Ints, count_width: int) -> bytes:
    """Faces as counts of ``count_width`` bytes, each followed by its vertex numbers of four bytes."""
    faces = np.arange(len(sizes), dtype=np.int64)
    count_starts = mesh.offsets[:-1] * 4 + faces * count_width
    corner_starts = np.arange(len(mesh.corners)) * 4 + (np.repeat(faces, sizes) + 1) * count_width
    buffer = np.empty(len(mesh.corners) * 4 + len(sizes) * count_width, np.uint8)
    count_bytes = sizes.astype("<i4").view(np.uint8).reshape(-1, 4)[:, :count_width]
    buffer[count_starts[:, None] + np.arange(count_width)] = count_bytes
    buffer[corner_starts[:, None] + np.arange(4)] = mesh.corners.astype("<i4").view(np.uint8).reshape(-1, 4)
    return buffer.tobytes()
