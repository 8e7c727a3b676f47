"""Polygon meshes to files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from .._atomic import atomic_write_bytes
from .._half_edges import first_few
from ..errors import MeshError, MeshFileError, ShapeError
from ..topology import Topology
from . import others
from .dxf import write_dxf
from .obj import write_obj
from .obj_attributes import ObjAttributes
from .off import write_off
from .ply import Bytes, write_ply
from .raw_mesh import Ints, RawMesh
from .rhino import write_rhino
from .rhino_parts import RhinoParts
from .written_back import HELD


def numbers_from(path: str | os.PathLike[str]) -> int:
    """What a format calls its first vertex and face: 1 in OBJ files, 0 in others."""
    return 1 if Path(path).suffix.lower() == ".obj" else 0


def save_mesh(
    path: str | os.PathLike[str],
    vertices: Tensor,
    topology: Topology,
    *,
    overwrite: bool = False,
    binary: bool = False,
    polylines: Sequence[Tensor] = (),
    colors: Tensor | None = None,
    attributes: ObjAttributes | RhinoParts | None = None,
) -> None:
    """Writes a polygon mesh; the file appears whole or not at all.

    The format follows from the extension. OBJ, OFF and PLY keep polygons, vertex order and orientation; their
    text holds the shortest digits that read back to the same float64. 3DM files (with the package rhino3dm) are in
    double precision, too; polygons of more than four corners are triangles there, which are read back as polygons. DXF
    files hold MESH entities, one for each object of ``attributes``, every digit and polygon. STL and GLB hold triangles
    only, in single precision.

    Args:
        path: the file; its folder must exist.
        vertices: (V, 3), any floating type and device.
        topology: connectivity, at least one face.
        overwrite: whether an existing file may be replaced. Without it, no file is replaced even if it comes
            into being during the call.
        binary: whether to write PLY in (little-endian) binary.
        polylines: OBJ files only: vertex numbers, two or more each, that are written as line elements, such as from
            ``PrincipalEdges.polylines``; :func:`load_edge_labels` reads the edges back.
        attributes: groups, materials, texture coordinates and colours of an OBJ file, or unit, layers and names of a
            3DM file (unit and layers of a DXF file), as they were read (:attr:`PolygonMesh.attributes`), which are
            written back; the mesh must have the same faces.
        colors: PLY files only: (V, 3) red, green and blue of every vertex, 0 to 1.

    Raises:
        ShapeError: if ``vertices`` or ``colors`` is not ``(V, 3)``; a batch has to be written mesh by mesh.
        MeshError: if a coordinate is not finite, there is no face, the format does not hold such faces, or a
            polyline has fewer than two vertices or one that does not exist.
        MeshFileError: if the extension is unknown or the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    known = (".obj", ".off", ".ply", ".3dm", ".dxf", *others.WRITTEN)
    if suffix not in known:
        raise MeshFileError(path, f"cannot write the format {suffix or '(none)'}. Known are {', '.join(known)}")
    if binary and suffix != ".ply":
        raise MeshFileError(path, "only PLY files have a binary form here. Leave out binary=True")
    if len(polylines) and suffix != ".obj":
        raise MeshFileError(path, "only OBJ files hold polylines. Use save_edge_labels beside files of other formats")
    if colors is not None and suffix != ".ply":
        raise MeshFileError(path, "only PLY files hold colours here. Leave out colors")
    if attributes is not None and not isinstance(attributes, HELD.get(suffix, ())):
        raise MeshFileError(path, "its attributes are not those of such a file. Leave out attributes")
    mesh = _raw_mesh(vertices, topology)
    if attributes is not None:
        _check_fit(mesh, attributes)
    if suffix == ".obj":
        lines = [_line_points(line, topology) for line in polylines]
        data = write_obj(mesh, lines, attributes if isinstance(attributes, ObjAttributes) else None, path.parent)
    elif suffix == ".3dm":
        data = write_rhino(mesh, attributes if isinstance(attributes, RhinoParts) else None)
    elif suffix == ".dxf":
        data = write_dxf(mesh, attributes if isinstance(attributes, RhinoParts) else None)
    elif suffix == ".off":
        data = write_off(mesh)
    elif suffix == ".ply":
        data = write_ply(mesh, binary=binary, colors=None if colors is None else _bytes(colors, topology))
    else:
        data = others.write_other(mesh, suffix)
    atomic_write_bytes(path, data, overwrite=overwrite)


def _raw_mesh(vertices: Tensor, topology: Topology) -> RawMesh:
    topology.check_vertices(vertices)
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"one mesh ({topology.num_vertices}, 3)", tuple(vertices.shape))
    if not topology.num_faces:
        raise MeshError("the mesh has no faces, and no file format here can be read back without any")
    points = vertices.detach().to("cpu", torch.float64).numpy()
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise MeshError(
            f"{bad.size} vertex(es) have coordinates that are not finite: vertices {first_few(bad, bad.size)}. "
            "Nothing was written."
        )
    return RawMesh(points, topology.corners.cpu().numpy(), topology.face_offsets.cpu().numpy())


def _check_fit(mesh: RawMesh, attributes: ObjAttributes | RhinoParts) -> None:
    if isinstance(attributes, RhinoParts):
        fits = len(attributes.owners) == len(mesh.offsets) - 1
    else:
        fits = _fits_obj(mesh, attributes)
    if not fits:
        raise MeshError("attributes: they are those of a mesh with other vertices or faces. Leave them out")


def _fits_obj(mesh: RawMesh, attributes: ObjAttributes) -> bool:
    fits = len(attributes.behind) in (0, len(mesh.points))
    fits = fits and attributes.corner_textures.size in (0, len(mesh.corners))
    return fits and all(place < len(mesh.offsets) for place, _ in attributes.statements)


def _bytes(colors: Tensor, topology: Topology) -> Bytes:
    if colors.shape != (topology.num_vertices, 3):
        raise ShapeError("colors", f"({topology.num_vertices}, 3)", tuple(colors.shape))
    values: Bytes = (255.0 * colors.detach().to("cpu", torch.float64).clamp(0.0, 1.0)).round().to(torch.uint8).numpy()
    return values


def _line_points(line: Tensor, topology: Topology) -> Ints:
    if line.ndim != 1 or line.dtype != torch.int64:
        raise ShapeError("polylines", "vertex numbers (n,) int64", f"{tuple(line.shape)} {line.dtype}")
    if len(line) < 2 or line.min() < 0 or line.max() >= topology.num_vertices:
        raise MeshError(
            f"polylines: expected two or more vertex numbers from 0 to {topology.num_vertices - 1}, "
            f"got {first_few(line.tolist(), len(line))}"
        )
    points: Ints = line.cpu().numpy()
    return points
