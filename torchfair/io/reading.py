"""Polygon meshes from files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import torch

from ..errors import MeshError, MeshFileError
from ..repair import repair_packed
from ..topology import Topology
from . import others
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .polygon_mesh import PolygonMesh
from .raw_mesh import RawMesh

_READERS: dict[str, Callable[[Path, bytes], RawMesh]] = {".obj": read_obj, ".off": read_off, ".ply": read_ply}
_COMPRESSED = {b"\x1f\x8b": "gzip", b"PK\x03\x04": "zip", b"BZh": "bzip2", b"\xfd7zXZ\0": "xz"}
_REMEDY = (
    "Reading with repair=True (--repair on the command line) re-orients faces and drops unused vertices, "
    "where that is enough"
)


def load_mesh(path: str | os.PathLike[str], *, repair: bool = False) -> PolygonMesh:
    """The polygon mesh of a file.

    The format follows from the extension, upper or lower case. OBJ, OFF and PLY (text and binary) keep
    polygons, vertex order and orientation exactly. STL, GLB, GLTF, DAE and 3MF go through trimesh with
    ``process=False``, and corners of STL files at exactly the same position become one vertex. Vertices that
    no face uses are legal.

    Args:
        path: the file.
        repair: whether to pass the mesh through :func:`torchfair.repair_mesh`; what that did is in
            ``PolygonMesh.repairs``.

    Raises:
        MeshFileError: the only error, for every fault of the file and of its mesh, with the line number
            where there is one.
    """
    path = Path(path)
    raw = _read_raw(path)
    vertices = torch.from_numpy(raw.points)
    try:
        if repair:
            repaired = repair_packed(vertices, raw.corners, raw.offsets)
            return PolygonMesh(repaired.vertices, repaired.topology, tuple(repaired.messages))
        return PolygonMesh(vertices, Topology.from_packed_faces(raw.corners, raw.offsets, len(raw.points)))
    except MeshError as error:
        raise MeshFileError(path, str(error) if repair else f"{error} {_REMEDY}.") from None


def _read_raw(path: Path) -> RawMesh:
    suffix = path.suffix.lower()
    if suffix not in (*_READERS, *others.READ):
        known = ", ".join((*_READERS, *others.READ))
        raise MeshFileError(path, f"the extension {suffix or '(none)'} is no known mesh format. Known are {known}")
    data = read_bytes(path)
    if suffix in _READERS:
        for magic, name in _COMPRESSED.items():
            if data.startswith(magic):
                raise MeshFileError(path, f"is compressed with {name}. Decompress it first")
        return _READERS[suffix](path, data)
    return others.read_other(path)


def read_bytes(path: Path) -> bytes:
    """The content of a regular file that is not empty.

    Raises:
        MeshFileError: if there is no such file or it cannot be read.
    """
    try:
        if path.is_dir():
            raise MeshFileError(path, "is a folder, not a file")
        if path.exists() and not path.is_file():
            raise MeshFileError(path, "is not a regular file")  # reading a pipe or device may never end
        data = path.read_bytes()
    except FileNotFoundError:
        raise MeshFileError(path, "does not exist") from None
    except OSError as error:
        raise MeshFileError(path, f"cannot be read ({error.strerror or error})") from None
    except MeshFileError:
        raise
    except ValueError as error:  # a NUL character in the path
        raise MeshFileError(path, f"is no usable file name ({error})") from None
    if not data.strip():
        raise MeshFileError(path, "is empty", 1)
    return data
