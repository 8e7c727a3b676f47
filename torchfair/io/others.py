"""Formats that trimesh reads and writes: triangles only, single precision in most of them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .._half_edges import first_few
from ..errors import MeshError, MeshFileError
from .raw_mesh import Origin, RawMesh, assemble
from .stl import write_stl

READ = (".glb", ".gltf", ".dae", ".3mf")
_PACKAGES = {".dae": "pycollada", ".3mf": "lxml networkx"}  # which trimesh reads with
WRITTEN = (".stl", ".glb")


def read_other(path: Path) -> RawMesh:
    """Mesh of a file that trimesh knows, with ``process=False``: vertices and faces as trimesh finds them.

    Raises:
        MeshFileError: whatever trimesh raises; a package that it reads with is not installed.
    """
    try:
        import trimesh

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded: Any = trimesh.load(str(path), process=False, force="mesh")
            points = np.asarray(loaded.vertices, np.float64).reshape(-1, 3)
            faces = np.asarray(loaded.faces, np.int64).reshape(-1, 3)
    except ImportError as error:
        packages = _PACKAGES.get(path.suffix.lower(), "trimesh")
        raise MeshFileError(path, f"needs more packages ({error}): pip install {packages}. Or save as OBJ") from None
    except Exception as error:  # trimesh lets through whatever its parsers raise
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise MeshFileError(path, f"trimesh cannot read it ({reason})") from None
    raw = assemble(Origin(path), points, faces.ravel(), np.full(len(faces), 3, np.int64))
    return raw._replace(split=True)


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
    if suffix == ".stl":
        return write_stl(mesh)
    import trimesh

    surface = trimesh.Trimesh(mesh.points, mesh.corners.reshape(-1, 3), process=False)
    data: Any = surface.export(file_type=suffix.removeprefix("."))
    return bytes(data)
