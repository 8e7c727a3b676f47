"""The mesh that came of another one as a file, and what of the file of that it does not hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..topology import Topology

_TRIANGLES = (".stl", ".glb")


def not_held(path: Path, source: PolygonMesh, *, same: bool, marks: bool) -> list[str]:
    """What of the file of a mesh another file does not hold, in words.

    Args:
        path: The other file.
        source: The mesh that was read.
        same: Whether the faces are those of the source.
        marks: Whether line elements of the source are carried on.
    """
    left_out = "" if source.attributes is None else source.attributes.left_out(path.suffix.lower(), same, marks)
    return [f"{path.name} does not hold {left_out} of the input"] if left_out else []


def save_result(
    path: Path,
    vertices: Tensor,
    topology: Topology,
    source: PolygonMesh,
    *,
    force: bool,
    polylines: Sequence[Tensor] = (),
    marks: bool = False,
) -> list[str]:
    """Writes a mesh that was made from another one, and says what of the file of that it does not hold.

    Groups, materials, texture coordinates and colours of an OBJ file are written back where the faces are the same;
    polygons are cut into triangles where the format has no others.

    Args:
        path: The file.
        vertices: (V, 3) of the mesh.
        topology: Of the mesh.
        source: What it was made from.
        force: Whether a file may be replaced.
        polylines: Line elements of an OBJ file.
        marks: Whether line elements of the source are carried on.
    """
    from ..io import save_mesh
    from ..io.written_back import written_back

    suffix, notes = path.suffix.lower(), []
    same = topology.corners.equal(source.topology.corners) and topology.face_offsets.equal(source.topology.face_offsets)
    notes += not_held(path, source, same=same, marks=marks)
    if suffix in _TRIANGLES and not topology.is_triangular:
        from ..topology import Topology
        from ..triangulation import triangulate

        notes.append(f"{path.name} holds its polygons cut into triangles: {suffix} files have no others")
        topology = Topology.from_faces(triangulate(vertices, topology).triangles, topology.num_vertices)
    kept = written_back(source.attributes, suffix, same_faces=same, count=topology.num_faces)
    save_mesh(path, vertices, topology, overwrite=force, polylines=polylines, attributes=kept)
    return notes
