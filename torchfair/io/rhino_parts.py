"""Which faces of a 3DM or DXF file are of which object, as it is written back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .raw_mesh import Floats, Ints, RawMesh

UNITLESS = "None"


@dataclass(frozen=True, eq=False)
class RhinoParts:
    """Objects of a 3DM or DXF file.

    Attributes:
        unit: Unit of length, by its name in Rhino, such as Millimeters.
        objects: Name (empty in DXF files) and layer (Roof::Glass) of each object.
        owners: (F,) object of each face.
    """

    unit: str
    objects: tuple[tuple[str, str], ...]
    owners: Ints

    def of_repaired(self, vertices: Ints, faces: Ints, corners: Ints) -> RhinoParts:
        """The same for what is left: old numbers of vertices, faces, and corners."""
        return replace(self, owners=self.owners[faces])

    def of_other_faces(self, count: int) -> RhinoParts:
        """The same unit for a mesh of so many other faces, one object with the name and layer of the first one."""
        return replace(self, objects=self.objects[:1], owners=np.zeros(count, np.int64))

    def left_out(self, suffix: str, same_faces: bool, marks: bool = False) -> str:
        """What a mesh file with that extension will not hold, in words; see ``ObjAttributes``."""
        if suffix == ".dxf" and any(name for name, _ in self.objects):
            return "the names of objects"
        if suffix not in (".3dm", ".dxf"):
            named = any(name or layer for name, layer in self.objects)
            return f"the unit ({self.unit})" + (" and names and layers of objects" if named else "")
        return "" if same_faces or len(self.objects) == 1 else "the single objects"


class SingleObject(NamedTuple):
    """One object of a mesh.

    Attributes:
        name: Of it.
        layer: Its layer.
        points: (n, 3) vertices that its faces use; of the only object all of them.
        faces: Numbers of these.
    """

    name: str
    layer: str
    points: Floats
    faces: list[Ints]


def single_objects(mesh: RawMesh, parts: RhinoParts) -> Iterator[SingleObject]:
    """Objects that have faces, one after the other."""
    for number, (name, layer) in enumerate(parts.objects):
        chosen = np.flatnonzero(parts.owners == number)
        if not chosen.size:
            continue
        faces = [mesh.corners[mesh.offsets[f] : mesh.offsets[f + 1]] for f in chosen.tolist()]
        whole = len(chosen) == len(mesh.offsets) - 1
        used = np.arange(len(mesh.points)) if whole else np.unique(np.concatenate(faces))
        yield SingleObject(name, layer, mesh.points[used], [np.searchsorted(used, face) for face in faces])


def one_object(mesh: RawMesh) -> RhinoParts:
    """All faces as one object without unit, name and layer."""
    return RhinoParts(UNITLESS, (("", ""),), np.zeros(len(mesh.offsets) - 1, np.int64))


def kinds_listed(others: Counter[str]) -> str:
    """Kinds of objects that were not read, behind a sentence; empty without any."""
    return ": " + ", ".join(f"{count} {kind}" for kind, count in sorted(others.items())) if others else ""
