"""Stereolithography (STL): loose triangles, as text or binary, without numbers of vertices.

Corners at the same position become one vertex where an edge joins them, numbered by first use; those that differ by
rounding to single precision too, with a note. Written is binary, in single precision.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .._ranges import ranges
from ..errors import MeshFileError
from ..repair import weld_soup
from .raw_mesh import Floats, Ints, Origin, RawMesh, assemble
from .text import check_text, first_words, quote, split_words, to_floats

_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEAD = 84
_KEYWORDS = frozenset(b"solid facet outer vertex endloop endfacet endsolid".split())
_ULPS = 2.0**-21  # of the largest coordinate: two corners, each a unit in the last place off in every direction


def read_stl(path: Path, data: bytes) -> RawMesh:
    """Triangle mesh of an STL file.

    Raises:
        MeshFileError: with the line of the fault, where the file is text; also if it is truncated.
    """
    notes: list[str] = []
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        points, lines = _read_text(path, data)
    else:
        points, lines = _read_binary(path, data, notes), None
    count = len(points) // 3
    raw = assemble(Origin(path, None, lines), points, np.arange(3 * count), np.full(count, 3))
    return _joined(raw, notes)


def write_stl(mesh: RawMesh) -> bytes:
    """The bytes of a binary STL file of triangles."""
    rows = np.zeros(len(mesh.offsets) - 1, _ROW)
    corners = mesh.points[mesh.corners].reshape(-1, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    rows["normal"], rows["corners"] = normals / np.where(lengths > 0.0, lengths, 1.0), corners
    return b"torchfair".ljust(80) + np.uint32(len(rows)).tobytes() + rows.tobytes()


def _joined(raw: RawMesh, notes: list[str]) -> RawMesh:
    """One vertex for corners at the same place that edges join."""
    exact = weld_soup(raw.points, raw.corners, raw.offsets, 0.0)
    near = weld_soup(raw.points, raw.corners, raw.offsets, _ULPS * float(np.abs(raw.points).max()))
    used, first, numbers = np.unique(near.corners, return_index=True, return_inverse=True)
    moved = len(np.unique(exact.corners)) - len(used)
    if moved > 0:
        notes.append(f"{moved} vertex(es) are at the place of another one but for rounding, and were welded to it")
    gone = len(raw.offsets) - len(near.offsets)
    if gone:
        notes.append(f"{gone} triangle(s) with two corners at one place are left out")
    order = np.argsort(first)
    rank = np.empty(len(used), np.int64)
    rank[order] = np.arange(len(used))
    names = raw.names
    if names.face_lines is not None:
        names = names.__class__(face_lines=names.face_lines[near.faces])
    return RawMesh(raw.points[used[order]], rank[numbers.reshape(-1)], near.offsets, names, tuple(notes))


def _read_binary(path: Path, data: bytes, notes: list[str]) -> Floats:
    if len(data) < _HEAD:
        raise MeshFileError(path, f"is no STL file: {len(data)} bytes are too few, and it does not begin with 'solid'")
    count = int.from_bytes(data[80:_HEAD], "little")
    end = _HEAD + count * _ROW.itemsize
    if len(data) < end:
        whole = (len(data) - _HEAD) // _ROW.itemsize
        fault = f"the header promises {count} triangles, but the file ends after {whole}; it is truncated or damaged"
        raise MeshFileError(path, fault)
    if len(data) > end:
        notes.append(f"{len(data) - end} byte(s) behind the last triangle that the header promises are not read")
    rows = np.frombuffer(data, _ROW, count, _HEAD)
    points: Floats = rows["corners"].reshape(-1, 3).astype(np.float64)
    return points


def _read_text(path: Path, data: bytes) -> tuple[Floats, Ints]:
    """Corners, three of each triangle, and the line where each triangle begins."""
    text = split_words(check_text(path, data))
    keywords = [word.lower() for word in first_words(text)]
    if not _KEYWORDS.issuperset(keywords):
        row = next(row for row, word in enumerate(keywords) if word not in _KEYWORDS)
        raise MeshFileError(path, f"{quote(keywords[row])} does not start a line of an STL file", int(text.lines[row]))
    if keywords[-1] != b"endsolid":
        raise MeshFileError(path, "ends without 'endsolid'; it is truncated or damaged", int(text.lines[-1]))
    starts = np.array(keywords)
    facets, rows = np.flatnonzero(starts == b"facet"), np.flatnonzero(starts == b"vertex")
    wrong = rows[text.sizes[rows] != 4]
    if wrong.size:
        fault = f"a vertex needs three coordinates, got {text.sizes[wrong[0]] - 1} number(s)"
        raise MeshFileError(path, fault, int(text.lines[wrong[0]]))
    owners = np.searchsorted(facets, rows) - 1
    counts = np.bincount(owners[owners >= 0], minlength=len(facets))
    bad = np.flatnonzero(counts != 3)
    if bad.size or (owners < 0).any():
        row, found = (facets[bad[0]], counts[bad[0]]) if bad.size else (rows[0], 0)
        raise MeshFileError(path, f"a facet needs three vertices, got {found}", int(text.lines[row]))
    first = text.starts[rows] + 1
    points = to_floats(path, text, ranges(first, np.full_like(first, 3))).reshape(-1, 3)
    return points, text.lines[facets]
