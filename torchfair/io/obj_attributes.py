"""What an OBJ file says of faces beside their vertices: groups, materials, smoothing, texture coordinates, colours."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .._ranges import ranges
from ..errors import MeshFileError
from .raw_mesh import Ints, RawMesh
from .text import Words, first_words, to_floats, to_ints

KEPT = (b"g", b"o", b"s", b"usemtl", b"mtllib")
_IN_WORDS = {b"g": "groups", b"o": "object names", b"s": "smoothing groups", b"usemtl": "materials",
    b"mtllib": "material files", b"vn": "normals", b"vt": "texture coordinates", b"l": "line elements",
    b"p": "points"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ObjAttributes:
    """Lines of an OBJ file that go with its faces and vertices, as they are written back.

    Attributes:
        folder: Of the file; material files are found from there.
        statements: Groups, objects, smoothing and materials, with the face before which each of them stands.
        behind: Words behind the coordinates of each vertex, such as colours; empty if there are none.
        textures: Lines of texture coordinates.
        corner_textures: (H,) texture coordinates of each corner, -1 for none.
        dropped: How often there were other statements, by keyword; these are not written.
    """

    folder: Path
    statements: tuple[tuple[int, bytes], ...] = ()
    behind: tuple[bytes, ...] = ()
    textures: tuple[bytes, ...] = ()
    corner_textures: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    dropped: Mapping[bytes, int] = field(default_factory=dict)

    def of_repaired(self, vertices: Ints, faces: Ints, corners: Ints) -> ObjAttributes:
        """The same for what is left: old numbers of vertices, faces, and corners (-1 for new ones)."""
        places = np.array([place for place, _ in self.statements], np.int64)
        moved = np.searchsorted(faces, places).tolist()
        textures = self.corner_textures
        return replace(
            self,
            statements=tuple(zip(moved, (line for _, line in self.statements), strict=True)),
            behind=tuple(self.behind[v] for v in vertices.tolist()) if self.behind else (),
            corner_textures=np.where(corners < 0, -1, textures[corners]) if textures.size else textures,
        )

    def left_out(self, suffix: str, same_faces: bool, marks: bool = False) -> str:
        """What a mesh file with that extension will not hold, in words.

        Args:
            suffix: The extension.
            same_faces: Whether it has the same faces.
            marks: Whether line elements are carried on.
        """
        names = [name(keyword) for keyword in self.dropped if not (marks and keyword == b"l")]
        if suffix != ".obj" or not same_faces:
            kept = dict.fromkeys(line.split()[0] for _, line in self.statements)
            names = [*map(name, kept), *names]
            names += ["texture coordinates"] if self.textures else []
            names += ["numbers behind vertices, such as colours"] if self.behind else []
        return ", ".join(names)


def name(keyword: bytes) -> str:
    """What a statement holds, in words."""
    word = keyword.decode("ascii", "replace")
    return f"{_IN_WORDS[keyword]} ({word})" if keyword in _IN_WORDS else f"statements {word}"


class CornerTextures(NamedTuple):
    """Numbers of texture coordinates as they are written.

    Attributes:
        given: (n,) the numbers, from 1, or from the last backwards if negative.
        corners: (n,) the corners that have one, among all of the mesh.
        lines: (n,) lines of their faces.
    """

    given: Ints
    corners: Ints
    lines: Ints


def read_attributes(
    path: Path,
    text: Words,
    face_lines: Ints,
    corner_sizes: Ints,
    textures: Callable[[], CornerTextures],
    *,
    behind: tuple[bytes, ...] = (),
    normals: int = 0,
) -> ObjAttributes:
    """The attributes of a file.

    Args:
        path: The file.
        text: Its words; those of vertices, normals and faces may be left out.
        face_lines: Lines of the faces.
        corner_sizes: Corners of each face.
        textures: What the corners say of texture coordinates; asked for if there are any.
        behind: Words behind the coordinates of each vertex.
        normals: How many statements of normals ``text`` leaves out.

    Raises:
        MeshFileError: if texture coordinates are no numbers, or a corner has some that do not exist.
    """
    keywords = first_words(text)
    counts = Counter(keywords) + Counter({b"vn": normals})
    dropped = {k: counts[k] for k in sorted(counts) if k not in (*KEPT, b"v", b"f", b"fo", b"vt")}
    kept = [row for row, keyword in enumerate(keywords) if keyword in KEPT] if counts.keys() & set(KEPT) else []
    places = np.searchsorted(face_lines, text.lines[kept]).tolist()
    none = np.zeros(0, np.int64)
    texture_rows = np.flatnonzero(np.array([keyword == b"vt" for keyword in keywords])) if counts[b"vt"] else none
    numbers = none
    if texture_rows.size:
        numbers = _corner_textures(path, text, texture_rows, textures(), int(corner_sizes.sum()))
    return ObjAttributes(
        path.parent,
        tuple(zip(places, (line_words(text, row) for row in kept), strict=True)),
        behind,
        tuple(line_words(text, row) for row in texture_rows.tolist()) if (numbers >= 0).any() else (),
        numbers if (numbers >= 0).any() else none,
        dropped,
    )


def line_words(text: Words, row: int, first: int = 0) -> bytes:
    """A line from its word ``first`` on, with one space between words."""
    return b" ".join(text.words[text.starts[row] + first : text.starts[row + 1]])


def written_textures(path: Path, text: Words, face_rows: Ints, words: list[bytes]) -> CornerTextures:
    """Those of corners, whose ``words`` are as they stand in the file.

    Raises:
        MeshFileError: if one is no whole number.
    """
    parts = [word.split(b"/")[1] if b"/" in word else b"" for word in words]
    has = np.array([bool(part) for part in parts], np.bool_)
    lines = text.lines[np.repeat(face_rows, text.sizes[face_rows] - 1)[has]]
    some = Words([part for part in parts if part], np.arange(has.sum() + 1), lines)
    return CornerTextures(to_ints(path, some, np.arange(has.sum())), np.flatnonzero(has), lines)


def _corner_textures(path: Path, text: Words, texture_rows: Ints, textures: CornerTextures, count: int) -> Ints:
    """(H,) number from zero of the texture coordinates of each corner, -1 without."""
    to_floats(path, text, ranges(text.starts[texture_rows] + 1, text.sizes[texture_rows] - 1))
    given = textures.given
    known = np.searchsorted(text.lines[texture_rows], textures.lines)
    numbers = np.where(given < 0, known + given, given - 1)
    wrong = np.flatnonzero((numbers < 0) | (numbers >= len(texture_rows)))
    if wrong.size:
        fault = f"a corner names texture coordinates {given[wrong[0]]}, but there are {len(texture_rows)}"
        raise MeshFileError(path, fault, int(textures.lines[wrong[0]]))
    result = np.full(count, -1)
    result[textures.corners] = numbers
    return result


def face_statements(mesh: RawMesh, attributes: ObjAttributes, folder: Path) -> str:
    """Faces with their texture coordinates, and the statements between them."""
    corners = list(map(str, (mesh.corners + 1).tolist()))
    textures = attributes.corner_textures
    if textures.size:
        sizes = np.diff(mesh.offsets)
        whole = np.repeat(np.minimum.reduceat(textures, mesh.offsets[:-1]) >= 0, sizes)
        behind = np.where(whole, textures + 1, 0).tolist()
        corners = [
            f"{corner}/{texture}" if texture else corner for corner, texture in zip(corners, behind, strict=True)
        ]
    offsets = mesh.offsets.tolist()
    faces = [f"f {' '.join(corners[a:b])}\n" for a, b in itertools.pairwise(offsets)]
    pieces, done = [], 0
    for place, line in attributes.statements:
        pieces += faces[done:place]
        pieces.append(_statement(line, attributes.folder, folder))
        done = max(done, place)
    return "".join([*pieces, *faces[done:]])


def _statement(line: bytes, source: Path, folder: Path) -> str:
    """A statement as text; a material file is found from the folder of the new file."""
    text = line.decode("utf-8", "surrogateescape")
    if text.startswith("mtllib "):
        file = source / text.removeprefix("mtllib ")
        if not Path(text.removeprefix("mtllib ")).is_absolute() and file.is_file():
            with contextlib.suppress(ValueError):  # another drive
                text = f"mtllib {Path(os.path.relpath(file, folder)).as_posix()}"
    return text + "\n"
