"""Wavefront OBJ: vertices and polygons.

Read are ``v x y z`` (colours or a weight behind are kept beside) and ``f`` (or the old ``fo``) with corners ``v``,
``v/vt``, ``v//vn`` or ``v/vt/vn``, counted from 1, or from the last vertex backwards if negative. Groups, materials,
smoothing and texture coordinates are kept beside (:mod:`torchfair.io.obj_attributes`), line elements ``l`` are read
elsewhere (:func:`torchfair.io.load_edge_labels`). Every other statement of the format, and of material files, is
skipped; a word that is none of them is an error, because a damaged ``v`` would shift all vertex numbers after it. A
backslash at the end of a line continues it, except in comments and names, where it ends a Windows path; the sign ^Z of
old systems ends the file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from .._ranges import ranges
from ..errors import MeshFileError
from .obj_attributes import ObjAttributes, face_statements, line_words, read_attributes, written_textures
from .quick_obj import quick_statements
from .raw_mesh import Floats, Ints, Origin, RawMesh, assemble
from .text import Words, check_text, first_words, quote, split_words, to_floats, to_ints
from .text_rows import face_lines, vertex_lines

_SKIPPED = frozenset(
    b"vt vn vp l p g o s mg usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj ctech "
    b"stech cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con vc t fo call csh res cdc cdp bzp bsp "
    b"newmtl Ka Kd Ks Ke Ns Ni Tf Tr d illum sharpness map_Ka map_Kd map_Ks map_Ns map_d map_bump bump disp decal "
    b"refl".split()
)
_VERTEX_SIZES = (3, 4, 6, 7)  # xyz, weight, rgb, both
_CORNER = re.compile(rb"[-+0-9]*(/[-+0-9]*){0,2}")
_NAMING = (b"o", b"g", b"usemtl", b"mtllib", b"usemap", b"maplib", b"shadow_obj", b"trace_obj", b"newmtl")
_END = b"\x1a"  # ^Z


def read_obj(path: Path, data: bytes) -> RawMesh:
    """Polygon mesh of an OBJ file.

    Raises:
        MeshFileError: with the line of the fault.
    """
    quick = _quick_mesh(path, data)
    return _careful_mesh(path, data) if quick is None else quick


def _careful_mesh(path: Path, data: bytes) -> RawMesh:
    """The mesh of any file, word by word."""
    text = obj_words(path, data)
    vertex_rows, face_rows = statement_rows(path, text, (b"v",), (b"f", b"fo"))
    points = read_vertices(path, text, vertex_rows)
    as_written = [text.words[i] for i in ranges(text.starts[face_rows] + 1, text.sizes[face_rows] - 1).tolist()]
    corners, sizes = vertex_numbers(path, text, vertex_rows, face_rows, slashes=b"/" in data)
    origin = Origin(path, text.lines[vertex_rows], text.lines[face_rows], first_index=1)
    mesh = assemble(origin, points, corners, sizes)
    more = (text.sizes[vertex_rows] > 4).any()
    behind = tuple(line_words(text, row, 4) for row in vertex_rows.tolist()) if more else ()
    textures = partial(written_textures, path, text, face_rows, as_written)
    attributes = read_attributes(path, text, text.lines[face_rows], sizes, textures, behind=behind)
    return mesh._replace(attributes=attributes)


def _quick_mesh(path: Path, data: bytes) -> RawMesh | None:
    """The same mesh of a usual file; None of others, and of those with a fault, which :func:`_careful_mesh` names."""
    found = quick_statements(data)
    if found is None:
        return None
    try:
        text = found.in_file(obj_words(path, found.rest))
        if any(rows.size for rows in statement_rows(path, text, (b"v", b"f", b"fo"))):
            return None
        known = np.repeat(np.searchsorted(found.vertex_lines, found.face_lines), found.sizes)
        corners = _from_zero(found.corners, known)
        origin = Origin(path, found.vertex_lines, found.face_lines, first_index=1)
        mesh = assemble(origin, found.points, corners, found.sizes)
        return mesh._replace(
            attributes=read_attributes(
                path, text, found.face_lines, found.sizes, found.corner_textures, normals=found.normals
            )
        )
    except MeshFileError:
        return None


def write_obj(
    mesh: RawMesh,
    polylines: Sequence[Ints] = (),
    attributes: ObjAttributes | None = None,
    folder: Path | None = None,
) -> bytes:
    """The bytes of an OBJ file; polylines, two or more vertex numbers each, become line elements."""
    lines = "".join(f"l {' '.join(map(str, (line + 1).tolist()))}\n" for line in polylines)
    vertices = vertex_lines(mesh.points, "v ")
    if attributes is None:
        return (vertices + face_lines(mesh, prefix="f ", first_index=1) + lines).encode()
    if attributes.behind:
        rows = zip(vertices.splitlines(), attributes.behind, strict=True)
        vertices = "".join(f"{row} {more.decode()}".rstrip() + "\n" for row, more in rows)
    textures = "".join(f"{line.decode()}\n" for line in attributes.textures)
    text = vertices + textures + face_statements(mesh, attributes, folder or attributes.folder) + lines
    return text.encode("utf-8", "surrogateescape")


def obj_words(path: Path, data: bytes) -> Words:
    """The words of an OBJ file, statement by statement."""
    return split_words(_plain_statements(check_text(path, data.partition(_END)[0])))


def _plain_statements(data: bytes) -> bytes:
    """``data`` without comments and with continued lines joined; no line changes its number."""
    if b"#" in data:
        data = re.sub(rb"#[^\r\n]*", b"", data)
    if not re.search(rb"\\[ \t]*[\r\n]", data):
        return data
    joined: list[bytes] = []
    lines = iter(data.splitlines())
    for line in lines:
        statement, blank_lines = line.rstrip(), 0
        while statement.endswith(b"\\") and statement.split(None, 1)[0] not in _NAMING:
            statement = statement[:-1] + b" " + next(lines, b"").rstrip()
            blank_lines += 1
        joined += [statement] + [b""] * blank_lines
    return b"\n".join(joined)


def statement_rows(path: Path, text: Words, *wanted: tuple[bytes, ...]) -> list[Ints]:
    """Lines that begin with one of the words of each of the ``wanted`` kinds.

    Raises:
        MeshFileError: if a line begins with a word that the format does not know.
    """
    keywords = first_words(text)
    unknown = set(keywords) - _SKIPPED - {b"v", b"f"}
    if unknown:
        row = next(row for row, word in enumerate(keywords) if word in unknown)
        raise MeshFileError(path, f"{quote(keywords[row])} does not start an OBJ statement", int(text.lines[row]))
    kind_of = dict.fromkeys(keywords, -1) | {word: kind for kind, words in enumerate(wanted) for word in words}
    kinds = np.fromiter(map(kind_of.__getitem__, keywords), np.int8, len(keywords))
    return [np.flatnonzero(kinds == kind) for kind in range(len(wanted))]


def vertex_numbers(
    path: Path, text: Words, vertex_rows: Ints, rows: Ints, *, slashes: bool, what: str = "a face corner"
) -> tuple[Ints, Ints]:
    """Vertex numbers from zero that the statements at ``rows`` hold, and how many each of them has.

    A number that does not exist may come out as anything outside the range of the vertices. Cuts the words of
    ``text`` down to the vertex; ``slashes`` says whether there may be any to cut off.

    Raises:
        MeshFileError: if a word is no reference to a vertex.
    """
    sizes = text.sizes[rows] - 1
    positions = ranges(text.starts[rows] + 1, sizes)
    if slashes and positions.size:
        _drop_slashes(path, text, positions, what)
    numbers = to_ints(path, text, positions)
    # a negative number counts back from the last vertex that stands before the statement
    known = np.repeat(np.searchsorted(vertex_rows, rows), sizes)
    return _from_zero(numbers, known), sizes


def _from_zero(numbers: Ints, known: Ints) -> Ints:
    """Vertex numbers from zero; of as many ``known`` vertices the last is -1."""
    return np.where((numbers < 0) & (known + numbers >= 0), known + numbers, numbers - 1)


def read_vertices(path: Path, text: Words, rows: Ints) -> Floats:
    """Positions (n, 3) of vertex statements, which stand in some rows."""
    sizes = text.sizes[rows] - 1
    wrong = np.flatnonzero(~np.isin(sizes, _VERTEX_SIZES))
    if wrong.size:
        fault = f"a vertex needs three coordinates, got {sizes[wrong[0]]} number(s)"
        raise MeshFileError(path, fault, int(text.lines[rows[wrong[0]]]))
    first = text.starts[rows] + 1
    to_floats(path, text, ranges(first + 3, sizes - 3))  # weights and colours are not used, but must be numbers
    return to_floats(path, text, ranges(first, np.full_like(first, 3))).reshape(-1, 3)


def _drop_slashes(path: Path, text: Words, positions: Ints, what: str) -> None:
    """Cuts corners such as 1/2/3 down to 1, in place."""
    places = positions.tolist()
    words = [text.words[place] for place in places]
    joined = b" ".join(words)
    codes = np.frombuffer(joined, np.uint8)
    slash = codes[(codes == ord("/")) | (codes == ord(" "))] == ord("/")
    too_many = slash[:-2] & slash[1:-1] & slash[2:]
    if joined.translate(None, b"0123456789+-/ ") or too_many.any():
        for place, word in zip(places, words, strict=True):
            if not _CORNER.fullmatch(word):
                fault = f"{what} must look like 1, 1/2, 1//3 or 1/2/3, got {quote(word)}"
                raise MeshFileError(path, fault, text.line_of(place))
    for place, word in zip(places, words, strict=True):
        text.words[place] = word.partition(b"/")[0]
