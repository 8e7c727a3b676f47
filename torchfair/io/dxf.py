"""Drawing exchange files (DXF): meshes in and out as text, in double precision.

MESH entities are read and written, polyface meshes (POLYLINE with flag 64) are read; each is an object on its layer.
Drawings of curves are read by :func:`~torchfair.io.load_curves`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import MeshFileError
from .dxf_frame import UNITS, framed
from .dxf_tags import Tags, count_of, entities, floats_of, header_value, integer_of, integers_of, tags_of
from .raw_mesh import Floats, Ints, Origin, RawMesh, assemble
from .rhino_parts import UNITLESS, RhinoParts, kinds_listed, one_object, single_objects

_POLYFACE, _PLACE, _RECORD = 64, 64, 128  # flags of POLYLINE, and of VERTEX: with a position, of a polyface mesh
_CORNERS = (71, 72, 73, 74)


class _Found(NamedTuple):
    layer: str
    points: Floats
    corners: Ints  # vertex numbers from zero, in this mesh
    sizes: Ints
    level: int = 0  # of subdivision, with which it is shown


def read_dxf(path: Path, data: bytes) -> RawMesh:
    """All meshes in the model space of a DXF file in one.

    Raises:
        MeshFileError: with the line of the fault; also if it is binary, or has no meshes.
    """
    tags = tags_of(path, data)
    others: Counter[str] = Counter()
    found = list(_meshes(path, tags, others))
    listed = kinds_listed(others)
    if not found:
        raise MeshFileError(path, f"has no MESH and no polyface mesh in its model space{listed}")
    counts = [len(mesh.points) for mesh in found]
    firsts = np.cumsum([0, *counts[:-1]])
    corners = np.concatenate([mesh.corners + first for mesh, first in zip(found, firsts, strict=True)])
    sizes = np.concatenate([mesh.sizes for mesh in found])
    owners = np.repeat(np.arange(len(found)), [len(mesh.sizes) for mesh in found])
    raw = assemble(Origin(path), np.concatenate([mesh.points for mesh in found]), corners, sizes)
    unit = UNITS.get(header_value(tags, "$INSUNITS", "0"), UNITLESS)
    parts = RhinoParts(unit, tuple(("", mesh.layer) for mesh in found), owners)
    smoothed = sum(mesh.level > 0 for mesh in found)
    notes = [f"left out of the file{listed}"] if others else []
    notes += [f"{smoothed} mesh(es) are shown subdivided in the drawing; their control meshes are read"] * (
        smoothed > 0
    )
    return raw._replace(attributes=parts, notes=tuple(notes))


def write_dxf(mesh: RawMesh, parts: RhinoParts | None = None) -> bytes:
    """The bytes of a DXF file (AutoCAD 2010), one MESH for each object; its digits read back to the same float64."""
    parts = parts or one_object(mesh)
    return framed([(one.layer, _body(one.points, one.faces)) for one in single_objects(mesh, parts)], parts.unit)


def _body(points: Floats, faces: list[Ints]) -> str:
    """What is said of a mesh in its subclass."""
    places = "".join(f"10\n{x!r}\n20\n{y!r}\n30\n{z!r}\n" for x, y, z in points.tolist())
    numbers = [n for face in faces for n in (len(face), *face.tolist())]
    rows = "".join(f"90\n{n}\n" for n in numbers)
    head = f"100\nAcDbSubDMesh\n71\n2\n72\n0\n91\n0\n92\n{len(points)}\n"
    return f"{head}{places}93\n{len(numbers)}\n{rows}94\n0\n95\n0\n90\n0\n"


def _meshes(path: Path, tags: Tags, others: Counter[str]) -> Iterator[_Found]:
    """Meshes of the model space; counts what else there is."""
    places: list[Tags] | None = None  # of the polyface mesh that is being read
    head = tags
    for entity in entities(tags, "ENTITIES"):
        kind = entity.kind
        if kind in ("VERTEX", "SEQEND") and places is not None:
            if kind == "VERTEX":
                places.append(entity)
                continue
            yield _polyface(path, head, places)
            places = None
        elif kind in ("VERTEX", "SEQEND") or entity.value(67, "0") == "1":  # of other polylines; on a sheet
            continue
        elif kind == "MESH":
            yield _mesh(path, entity)
        elif kind == "POLYLINE" and integer_of(path, entity, 70) & _POLYFACE:
            head, places = entity, []
        else:
            others[kind] += 1
    if places is not None:
        raise MeshFileError(path, "a polyface mesh does not end (SEQEND); the file is truncated", head.line(0))


def _mesh(path: Path, entity: Tags) -> _Found:
    """A MESH entity: 92 counts vertices, 93 the numbers in the list of faces behind them."""
    starts = np.flatnonzero(entity.codes == 92)
    if not starts.size:
        raise MeshFileError(path, "a MESH has no number of vertices (group 92)", entity.line(0))
    row, count = int(starts[0]) + 1, count_of(path, entity, int(starts[0]))
    rows = row + 3 * count
    if not np.array_equal(entity.codes[row:rows], np.tile([10, 20, 30], count)):
        raise MeshFileError(path, f"a MESH promises {count} vertices (group 92), but has others", entity.line(row - 1))
    points = floats_of(path, entity, np.arange(row, rows)).reshape(-1, 3)
    if rows >= len(entity.codes) or entity.codes[rows] != 93:
        raise MeshFileError(path, "a MESH has no list of faces (group 93) behind its vertices", entity.line(row - 1))
    length = count_of(path, entity, rows)
    listed = np.arange(rows + 1, rows + 1 + length)
    if listed.size and (listed[-1] >= len(entity.codes) or (entity.codes[listed] != 90).any()):
        raise MeshFileError(path, f"a MESH promises {length} numbers in its list of faces (group 93), but has others",
            entity.line(rows))  # fmt: skip
    numbers = integers_of(path, entity, listed)
    sizes, kept = [], np.ones(length, bool)
    place = 0
    while place < length:
        size = int(numbers[place])
        if size < 3 or place + size >= length:
            raise MeshFileError(path, f"a face of a MESH has {size} corners: at least 3 that are there are needed",
                entity.line(int(listed[place])))  # fmt: skip
        kept[place] = False
        sizes.append(size)
        place += size + 1
    corners = numbers[kept]
    _check(path, corners, count, entity, listed[kept], 0)
    return _Found(entity.value(8, "0"), points, corners, np.array(sizes, np.int64), integer_of(path, entity, 91))


def _polyface(path: Path, head: Tags, parts: list[Tags]) -> _Found:
    """A polyface mesh: VERTEX entities with positions, then others with up to four numbers, below 0 at hidden edges."""
    points, corners, sizes = [], [], []
    records = []
    for part in parts:
        if integer_of(path, part, 70) & _PLACE:
            rows = [np.flatnonzero(part.codes == code)[:1] for code in (10, 20, 30)]
            if not all(row.size for row in rows):
                raise MeshFileError(path, "a vertex of a polyface mesh has no position", part.line(0))
            points.append(floats_of(path, part, np.concatenate(rows)))
        else:
            records.append(part)
    for part in records:
        face = [abs(integer_of(path, part, code)) - 1 for code in _CORNERS]
        face = [v for v in face if v >= 0]
        if len(face) < 3:
            continue  # a line
        _check(path, np.array(face), len(points), part, np.zeros(len(face), np.int64), 1)
        corners += face
        sizes.append(len(face))
    places = np.array(points, np.float64).reshape(-1, 3)
    return _Found(head.value(8, "0"), places, np.array(corners, np.int64), np.array(sizes, np.int64))


def _check(path: Path, corners: Ints, count: int, entity: Tags, rows: Ints, first: int) -> None:
    """All corners of one mesh are vertices of that one, not of another in the file."""
    wrong = np.flatnonzero((corners < 0) | (corners >= count))
    if wrong.size:
        fault = (
            f"a face uses vertex {corners[wrong[0]] + first}, but those of its mesh are {first}..{count - 1 + first}"
        )
        raise MeshFileError(path, fault, entity.line(int(rows[wrong[0]])))
