"""Formats that trimesh reads and writes: triangles only, single precision in most of them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .._half_edges import first_few
from ..errors import MeshError, MeshFileError
from .raw_mesh import Floats, Ints, Origin, RawMesh, assemble

READ = (".stl", ".glb", ".gltf", ".dae", ".3mf")
WRITTEN = (".stl", ".glb")


def read_other(path: Path) -> RawMesh:
    """Mesh of a file that trimesh knows, with ``process=False``: vertices and faces as trimesh finds them.

    STL files hold loose triangles; there, and only there, corners at exactly the same position become one
    vertex (numbered in order of first use), since no topology would be left otherwise.

    Raises:
        MeshFileError: whatever trimesh raises.
    """
    try:
        import trimesh

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded: Any = trimesh.load(str(path), process=False, force="mesh")
            points = np.asarray(loaded.vertices, np.float64).reshape(-1, 3)
            faces = np.asarray(loaded.faces, np.int64).reshape(-1, 3)
    except Exception as error:  # trimesh lets through whatever its parsers raise
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise MeshFileError(path, f"trimesh cannot read it ({reason})") from None
    if path.suffix.lower() == ".stl":
        points, faces = _merge_equal(points, faces)
    return assemble(Origin(path), points, faces.ravel(), np.full(len(faces), 3, np.int64))


def _merge_equal(points: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """One vertex for each distinct position, in order of first use."""
    order = np.lexsort(points.T)
    new = np.append(True, (np.diff(points[order], axis=0) != 0).any(axis=1))[: order.size]
    group = np.empty(order.size, np.int64)
    group[order] = np.cumsum(new) - 1
    first = order[new]  # the sort is stable, so this is the first use
    rank = np.empty(first.size, np.int64)
    rank[np.argsort(first)] = np.arange(first.size)
    return points[np.sort(first)], rank[group][faces]


def write_other(mesh: RawMesh, suffix: str) -> bytes:
    """The bytes of a file of triangles in the format of ``suffix``.

    Raises:
        MeshError: if a face is not a triangle.
    """
    sizes = np.diff(mesh.offsets)
    others = np.flatnonzero(sizes != 3)
    if others.size:
        raise MeshError(
            f"{suffix} files hold triangles only, but {others.size} face(s) are not: faces "
            f"{first_few(others, others.size)}. Write OBJ, OFF or PLY, or triangulate first."
        )
    import trimesh

    surface = trimesh.Trimesh(mesh.points, mesh.corners.reshape(-1, 3), process=False)
    data: Any = surface.export(file_type=suffix.removeprefix("."))
    return bytes(data)
