"""Rhino's 3DM files, by the package rhino3dm: meshes in double precision, with unit, layers and names.

The package gives no access to the table of n-gons of a mesh: faces of more than four corners are written as triangles,
with a user text ``torchfair ngons`` that says which of them belong together, and are read back from it.
"""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from .._names import first_few
from ..errors import MeshFileError, TorchfairError
from ..topology import Topology
from ..triangulation import triangulate
from .raw_mesh import Floats, Origin, RawMesh, assemble
from .rhino_parts import RhinoParts, SingleObject, kinds_listed, one_object, single_objects
from .rhino_surfaces import Cells, Patch, patches_of, sampled

_NGONS = "torchfair ngons"
_VERSION = 7
_SAMPLE = "surfaces=N (--surfaces N on the command line), N cells in each direction"
_MOST_NESTED = 32  # blocks in blocks


def rhino_package() -> Any:
    """The package rhino3dm.

    Raises:
        TorchfairError: it is not installed.
    """
    try:
        import rhino3dm
    except ImportError:
        raise TorchfairError("3DM files need rhino3dm: pip install 'torchfair[rhino]'. Or save as OBJ") from None
    return rhino3dm


def rhino_model(path: Path) -> tuple[Any, Any]:
    """The package rhino3dm, and a 3DM file as it reads it.

    Raises:
        MeshFileError: the file cannot be read.
        TorchfairError: rhino3dm is not installed.
    """
    rhino = rhino_package()
    model = rhino.File3dm.Read(str(path))
    if model is None:
        raise MeshFileError(path, "is no 3DM file that can be read")
    return rhino, model


def read_rhino(path: Path, data: bytes, surfaces: Cells | None = None) -> RawMesh:
    """All visible meshes of a 3DM file in one, blocks where they are inserted; surfaces too, by grids of cells.

    Raises:
        MeshFileError: it cannot be read, has no mesh, or trimmed surfaces that are to be sampled.
        TorchfairError: rhino3dm is not installed.
    """
    rhino, model = rhino_model(path)
    points: list[Floats] = []
    faces: list[list[int]] = []
    objects: list[tuple[str, str]] = []
    owners: list[int] = []
    others: Counter[str] = Counter()
    trimmed: list[str] = []
    patches = count = 0
    for item, place in _items(rhino, model):
        name, layer = item.Attributes.Name or "", _layer_of(model, item)
        found = patches_of(rhino, item.Geometry)
        trimmed += [_called(number, found, name, layer) for number, patch in enumerate(found) if patch.trimmed]
        if surfaces is not None and any(patch.surface is None for patch in found):
            raise MeshFileError(path, f"surfaces of {name or 'an object'!r} are damaged. Hide it, or mend it in Rhino")
        if isinstance(item.Geometry, rhino.Mesh):
            parts = [(_points(item.Geometry), _faces(item.Geometry, item.Attributes.GetUserString(_NGONS)))]
        elif found and surfaces is not None:
            parts = [sampled(patch, surfaces) for patch in found if not patch.trimmed]
        else:
            others[type(item.Geometry).__name__] += 1
            patches += len(found)
            continue
        turned = np.linalg.det(place[:3, :3]) < 0.0  # a mirrored block
        for own, rings in parts:
            points.append(own @ place[:3, :3].T + place[:3, 3])
            faces += [[v + count for v in (ring[::-1] if turned else ring)] for ring in rings]
            owners += [len(objects)] * len(rings)
            count += len(own)
        objects.append((name, layer))
    if trimmed and surfaces is not None:
        raise MeshFileError(path, f"{len(trimmed)} trimmed surface(s), whose boundary no grid of parameters follows: "
            f"{first_few(trimmed, len(trimmed))}. Hide them, or mesh them in Rhino")  # fmt: skip
    if not points:
        way = f", or sample them: {_SAMPLE}" if patches else ""
        raise MeshFileError(path, f"has no visible meshes{kinds_listed(others)}. Mesh its surfaces in Rhino first{way}")
    sizes = np.array([len(face) for face in faces], np.int64)
    corners = np.array([v for face in faces for v in face], np.int64)
    raw = assemble(Origin(path), np.concatenate(points), corners, sizes)
    attributes = RhinoParts(model.Settings.ModelUnitSystem.name, tuple(objects), np.array(owners, np.int64))
    way = f". Surfaces are sampled by {_SAMPLE}" if patches else ""
    notes = [f"left out of the file{kinds_listed(others)}{way}"] if others else []
    return raw._replace(attributes=attributes, notes=tuple(notes))


def write_rhino(mesh: RawMesh, parts: RhinoParts | None = None) -> bytes:
    """The bytes of a 3DM file, in double precision.

    Raises:
        TorchfairError: rhino3dm is not installed, or refuses to write.
    """
    rhino = rhino_package()
    parts = parts or one_object(mesh)
    model = rhino.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino.UnitSystem, parts.unit)
    layers: dict[str, int] = {}
    for one in single_objects(mesh, parts):
        made, table = _made(rhino, one)
        attributes = rhino.ObjectAttributes()
        attributes.Name = one.name
        if one.layer:
            attributes.LayerIndex = _layer(rhino, model, one.layer, layers)
        if table:
            attributes.SetUserString(_NGONS, json.dumps(table))
        model.Objects.AddMesh(made, attributes)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mesh.3dm"
        if not model.Write(str(file), _VERSION):
            raise TorchfairError("rhino3dm cannot write this mesh. Write OBJ, OFF or PLY")
        return file.read_bytes()


def _items(rhino: Any, model: Any) -> Iterator[tuple[Any, Floats]]:
    """Visible objects, with the maps (4, 4) that put them into place."""
    definitions = {str(block.Id): [str(i) for i in block.GetObjectIds()] for block in model.InstanceDefinitions}
    by_id = {str(item.Attributes.Id): item for item in model.Objects}

    def walk(item: Any, place: Floats, depth: int) -> Iterator[tuple[Any, Floats]]:
        if not item.Attributes.Visible or depth > _MOST_NESTED:
            return
        if not isinstance(item.Geometry, rhino.InstanceReference):
            yield item, place
            return
        inner = place @ _matrix(item.Geometry.Xform)
        for part in definitions.get(str(item.Geometry.ParentIdefId), ()):
            if part in by_id:
                yield from walk(by_id[part], inner, depth + 1)

    for item in model.Objects:
        if not item.Attributes.IsInstanceDefinitionObject:
            yield from walk(item, np.eye(4), 0)


def _layer_of(model: Any, item: Any) -> str:
    """Path of the layer of an object; empty where it is on none."""
    number = item.Attributes.LayerIndex
    return (model.Layers[number].FullPath or "") if 0 <= number < len(model.Layers) else ""


def _called(number: int, patches: list[Patch], name: str, layer: str) -> str:
    """What a surface of an object is called."""
    face = f"face {number} of " if len(patches) > 1 else ""
    return f"{face}{name or 'an object without a name'}{f' on layer {layer}' if layer else ''}"


def _matrix(transform: Any) -> Floats:
    return np.array([[getattr(transform, f"M{i}{j}") for j in range(4)] for i in range(4)])


def _points(mesh: Any) -> Floats:
    places = mesh.Vertices.ToPoint3dArray()
    return np.array([(place.X, place.Y, place.Z) for place in places], np.float64).reshape(-1, 3)


def _faces(mesh: Any, table: str | None) -> list[list[int]]:
    """Faces of a mesh, with the triangles of n-gons put together again, as far as they are still there."""
    faces = [list(dict.fromkeys(mesh.Faces[i])) for i in range(mesh.Faces.Count)]
    try:
        ngons = json.loads(table) if table else []
        for first, corners in reversed(ngons):
            triangles = faces[first : first + len(corners) - 2]
            if {v for face in triangles for v in face} == set(corners) and all(len(face) == 3 for face in triangles):
                faces[first : first + len(corners) - 2] = [corners]
    except (ValueError, TypeError):  # a text that somebody has changed
        return faces
    return faces


def _made(rhino: Any, one: SingleObject) -> tuple[Any, list[tuple[int, list[int]]]]:
    """The mesh of an object, and its n-gons: the first triangle of each, and its corners."""
    made = rhino.Mesh()
    made.Vertices.UseDoublePrecisionVertices = True
    for number, place in enumerate(one.points.tolist()):
        made.Vertices.Add(*place)
        made.Vertices.SetPoint3dAt(number, rhino.Point3d(*place))  # adding alone is in single precision
    table: list[tuple[int, list[int]]] = []
    for corners in one.faces:
        if len(corners) <= 4:
            made.Faces.AddFace(*corners.tolist())
            continue
        table.append((made.Faces.Count, corners.tolist()))
        alone = torch.from_numpy(one.points[corners])
        for triangle in triangulate(alone, Topology.from_faces([list(range(len(corners)))])).triangles.tolist():
            made.Faces.AddFace(*corners[triangle].tolist())
    made.Normals.ComputeNormals()
    return made, table


def _layer(rhino: Any, model: Any, path: str, known: dict[str, int]) -> int:
    """Number of a layer such as Roof::Glass, which is made where it is not there."""
    if path not in known:
        above, _, name = path.rpartition("::")
        layer = rhino.Layer()
        layer.Name = name
        if above:
            layer.ParentLayerId = model.Layers[_layer(rhino, model, above, known)].Id
        known[path] = model.Layers.Add(layer)
    return known[path]
