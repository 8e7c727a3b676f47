"""Polygon meshes from files."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from .._names import PlacedError
from ..errors import MeshFileError
from ..repair import coincident_edges, repair_packed, weld_packed
from ..topology import Topology
from . import others
from .dxf import read_dxf
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .polygon_mesh import PolygonMesh
from .raw_mesh import Ints, RawMesh
from .rhino import read_rhino
from .rhino_surfaces import Cells, checked_cells
from .stl import read_stl

_READERS: dict[str, Callable[[Path, bytes], RawMesh]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
    ".3dm": read_rhino,
    ".dxf": read_dxf,
}
_SPLIT = "files of this format repeat vertices where normals, textures or materials differ: "
_COMPRESSED = {b"\x1f\x8b": "gzip", b"PK\x03\x04": "zip", b"BZh": "bzip2", b"\xfd7zXZ\0": "xz"}


def load_mesh(
    path: str | os.PathLike[str],
    *,
    repair: bool = False,
    weld: bool | float = False,
    split_edges: bool = False,
    surfaces: int | tuple[int, int] | None = None,
) -> PolygonMesh:
    """The polygon mesh of a file.

    The format follows from the extension, upper or lower case. OBJ, OFF and PLY (text and binary) keep polygons, vertex
    order and orientation exactly. Corners of STL files at the same position become one vertex where an edge joins them.
    3DM files hold their visible meshes in one (with the package rhino3dm), DXF files their MESH entities and polyface
    meshes. GLB, GLTF, DAE and 3MF go through trimesh
    with ``process=False``, and are welded as by ``weld=True``, with a note: such files repeat vertices where normals,
    textures or materials differ. Vertices that no face uses are legal. Edges of the boundary that lie on each other are
    told in ``PolygonMesh.notes``, and so is a mesh most of whose edges are boundary.

    Args:
        path: the file.
        repair: whether to pass the mesh through :func:`torchfair.repair_mesh`; what that did is in
            ``PolygonMesh.repairs``, in the numbers of the file.
        weld: whether edges of the boundary at the same place become one, see :func:`torchfair.repair_mesh`: True, or
            the largest distance in the unit of the file. Without ``repair`` nothing else is done. In GLB, GLTF, DAE
            and 3MF files False stands for True; 0.0 joins only what is at the same place to the last bit.
        split_edges: whether to repair, and to split edges of more than two faces, too.
        surfaces: 3DM files only: the surfaces in it are sampled, too, by a grid in their parameters with so many cells
            in each direction, or in the first and the second; lines where a surface may have a kink are added. Its
            points are exact. Seams of closed surfaces are closed, poles are single vertices. Faces of polysurfaces
            meet in edges only where their grids do; ``weld`` joins them there, with the tolerance of the model.

    Raises:
        MeshFileError: for every fault of the file and of its mesh, with the line number where there is one, in the
            numbers of the file (from 1 in OBJ files), with what mends it; for trimmed surfaces that are to be sampled.
        SettingsError: ``weld`` is no distance, or ``surfaces`` no number of cells.
        TorchfairError: rhino3dm, which reads 3DM files, is not installed.
    """
    path = Path(path)
    raw = _read_raw(path, None if surfaces is None else checked_cells(surfaces))
    repair = repair or split_edges
    try:
        mesh = _made(raw, repair, weld, split_edges)
    except PlacedError as error:
        first = error.sentence.face
        fault = f"{error.sentence.told(raw.names)}{_remedy(raw, repair, weld, split_edges)}"
        raise MeshFileError(path, fault, None if first is None else raw.names.line(first)) from None
    if not mesh.topology.num_faces:
        raise MeshFileError(path, "no face is left of the mesh: " + " ".join(mesh.repairs))
    return mesh


def _made(raw: RawMesh, repair: bool, weld: bool | float, split_edges: bool) -> PolygonMesh:
    vertices = torch.from_numpy(raw.points)
    as_it_comes = not repair and weld is False
    weld = True if raw.split and weld is False else weld
    if not repair and weld is False:
        topology = Topology._of_own_faces(_writable(raw.corners), _writable(raw.offsets), len(raw.points))
        mesh = PolygonMesh(vertices, topology, (), raw.notes, raw.names)
        mesh = replace(mesh, attributes=raw.attributes)
    else:
        if repair:
            mended = repair_packed(vertices, raw.corners, raw.offsets, weld=weld, split_edges=split_edges)
        else:
            mended = weld_packed(vertices, raw.corners, raw.offsets, weld)
        kept = [part.numpy() for part in (mended.kept_vertices, mended.kept_faces, mended.kept_corners)]
        same = len(kept[0]) == len(raw.points) and bool((kept[0] == np.arange(len(kept[0]))).all())
        done = tuple(sentence.told(raw.names) for sentence in mended.sentences)
        mesh = PolygonMesh(
            mended.vertices,
            mended.topology,
            () if as_it_comes else done,
            (*raw.notes, *(_SPLIT + sentence for sentence in done)) if as_it_comes else raw.notes,
            replace(raw.names, vertices=kept[0], faces=kept[1]),
            None if same else mended.vertex_map,
            raw.attributes and raw.attributes.of_repaired(*kept),
        )
    seams = coincident_edges(mesh.vertices, mesh.topology)
    told = []
    if seams is not None:
        hint = " weld=True (--weld on the command line) joins them." if weld is False else ""
        told.append(seams.told(mesh.names) + hint)
    told += _mostly_open(mesh.topology, seams is None)
    return replace(mesh, notes=(*mesh.notes, *told))


def _writable(numbers: Ints) -> Ints:
    return numbers if numbers.flags.writeable else numbers.copy()


def _mostly_open(topology: Topology, apart: bool) -> list[str]:
    """Says so where most edges are boundary; ``apart``: none of them lie on each other."""
    count, inner = topology.num_edges, topology.num_interior_edges
    if 2 * inner >= count:
        return []
    words = f"most edges ({count - inner} of {count}) are boundary, and those carry no E."
    why = " If its faces are meant to touch, they are farther apart than is welded by default."
    return [words + (why if apart else "")]


def _remedy(raw: RawMesh, repair: bool, weld: bool | float, split_edges: bool) -> str:
    """How to read the file after all; empty if no repair mends it."""
    ways = [] if repair else [(False, "repair=True (--repair on the command line)")]
    ways += [] if split_edges else [(True, "split_edges=True (--split-edges on the command line)")]
    for split, words in ways:
        try:
            mended = _made(raw, True, weld, split)
        except PlacedError:
            continue
        if mended.topology.num_faces:
            return f" {words} mends this: {' '.join(mended.repairs)}"
    return ""


def _read_raw(path: Path, surfaces: Cells | None) -> RawMesh:
    suffix = path.suffix.lower()
    if suffix not in (*_READERS, *others.READ):
        if path.is_dir():
            raise MeshFileError(path, "is a folder: name the mesh files in it")
        known = ", ".join((*_READERS, *others.READ))
        raise MeshFileError(path, f"the extension {suffix or '(none)'} is no known mesh format. Known are {known}")
    data = read_bytes(path)
    if suffix in _READERS:
        for magic, name in _COMPRESSED.items():
            if data.startswith(magic):
                raise MeshFileError(path, f"is compressed with {name}. Decompress it first")
        return read_rhino(path, data, surfaces) if suffix == ".3dm" else _READERS[suffix](path, data)
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
        with path.open("rb", buffering=0) as file:  # without a copy
            data = file.readall()
    except FileNotFoundError:
        raise MeshFileError(path, "does not exist") from None
    except OSError as error:
        raise MeshFileError(path, f"cannot be read ({error.strerror or error})") from None
    except MeshFileError:
        raise
    except ValueError as error:  # a NUL character in the path
        raise MeshFileError(path, f"is no usable file name ({error})") from None
    if not data or data.isspace():
        raise MeshFileError(path, "is empty", 1)
    return data
