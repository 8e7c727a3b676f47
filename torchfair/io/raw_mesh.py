"""What every file format is read into and written from, and the checks common to all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from .._names import FROM_ZERO, Names
from .._names import Ints as Ints
from ..errors import MeshFileError

if TYPE_CHECKING:
    from .obj_attributes import ObjAttributes
    from .rhino_parts import RhinoParts

Floats = npt.NDArray[np.float64]


class Origin(NamedTuple):
    """Where vertices and faces stand in a file, for error messages."""

    path: Path
    vertex_lines: Ints | None = None  # line of each vertex; None in binary files
    face_lines: Ints | None = None
    first_index: int = 0  # how the format counts vertices

    def names(self) -> Names:
        """What vertices and faces are called."""
        return Names(self.first_index, face_lines=self.face_lines)


class RawMesh(NamedTuple):
    """Points and packed faces in file order; face ``i`` is ``corners[offsets[i]:offsets[i + 1]]``."""

    points: Floats  # (V, 3)
    corners: Ints  # vertex numbers from zero
    offsets: Ints  # (F+1,)
    names: Names = FROM_ZERO
    notes: tuple[str, ...] = ()  # what was left out, or read in spite of a fault
    attributes: ObjAttributes | RhinoParts | None = None  # of OBJ, 3DM and DXF files
    split: bool = False  # of a format that repeats vertices where faces differ in normals, textures or materials


def assemble(origin: Origin, points: Floats, corners: Ints, sizes: Ints) -> RawMesh:
    """A checked mesh.

    Raises:
        MeshFileError: if there are no vertices or faces, a coordinate is not finite, a face has fewer than
            three corners, or a vertex number does not exist.
    """
    for count, name in ((len(points), "vertices"), (len(sizes), "faces")):
        if not count:
            raise MeshFileError(origin.path, f"the mesh has no {name}")
    if not np.isfinite(points).all():
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        values = ", ".join(map(repr, points[bad[0]].tolist()))
        fault = f"vertex {bad[0] + origin.first_index} has coordinates that are not finite numbers: {values}"
        raise MeshFileError(origin.path, fault, _line(origin.vertex_lines, bad[0]))
    offsets = np.zeros(len(sizes) + 1, np.int64)
    np.cumsum(sizes, out=offsets[1:])
    small = np.flatnonzero(sizes < 3)
    if small.size:
        fault = f"face {small[0] + origin.first_index} has {sizes[small[0]]} corner(s); a face needs three or more"
        raise MeshFileError(origin.path, fault, _line(origin.face_lines, small[0]))
    if corners.min() < 0 or corners.max() >= len(points):
        outside = np.flatnonzero((corners < 0) | (corners >= len(points)))
        face = int(np.searchsorted(offsets, outside[0], side="right")) - 1
        first = origin.first_index
        fault = (
            f"face {face + first} uses vertex {(corners[outside[:1]] + first)[0]}, "
            f"but the vertices are numbered {first}..{len(points) - 1 + first}"
        )
        raise MeshFileError(origin.path, fault, _line(origin.face_lines, face))
    return RawMesh(points, corners, offsets, origin.names())


def _line(lines: Ints | None, row: int) -> int | None:
    return None if lines is None else int(lines[row])
