"""A polygon mesh as it comes from a file."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from .._names import FROM_ZERO, Names
from .._short_repr import short_repr
from ..topology import Topology
from .obj_attributes import ObjAttributes
from .rhino_parts import RhinoParts


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Positions and connectivity together, for files and the command line only.

    Everything else in torchfair takes ``vertices`` and ``topology`` apart, so that one topology serves many
    vertex tensors.

    Attributes:
        vertices: (V, 3) float64 positions in the unit of the file.
        topology: connectivity.
        repairs: what a repair did to the mesh of the file, in words; empty if nothing.
        notes: what is to be known of the mesh or the file beside, in words.
        names: what vertices and faces are called in the file, for messages.
        vertex_map: (V of the file,) number of each vertex of the file in this mesh, -1 where it was dropped; None if
            all are there in the order of the file.
        attributes: groups, materials, texture coordinates and the like of an OBJ file, or unit, layers and names of a
            3DM file, for :func:`save_mesh`; None without.
    """

    vertices: Tensor
    topology: Topology
    repairs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    names: Names = FROM_ZERO
    vertex_map: Tensor | None = None
    attributes: ObjAttributes | RhinoParts | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        self.topology.check_vertices(self.vertices)
